//! How a person walks, sets off, sits down, sits and gets up: what an animator would call style, in figures.
//!
//! The same figures of a motion, of a library and of captures: a motion stands beside what people do.

mod sitting;
mod walking;

use serde::{Deserialize, Serialize};

use crate::action::ActionLabel;
use crate::library::{MotionLibrary, Segment, Source};
use crate::math::rotation::wrap_angle;
use crate::motion::{FRAME_RATE, Joint, Motion, Pose, Posture};

/// Lower than this over the floor the pelvis is on its way to a seat, sits or crouches, metres.
const STANDING: f32 = 0.85;

/// A group of rows: `T` is one value, all values, or their median where there are any.
macro_rules! rows {
    ($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident,)+ }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
        pub struct $name<T = Option<f32>> {
            $($(#[$field_doc])* pub $field: T,)+
        }

        impl $name<Vec<f32>> {
            fn add(&mut self, one: $name) {
                $(self.$field.extend(one.$field);)+
            }

            fn merge(&mut self, other: Self) {
                $(self.$field.extend(other.$field);)+
            }

            fn medians(&self) -> $name {
                $name { $($field: median(&self.$field),)+ }
            }

            fn rows(&self) -> Vec<(&'static str, &[f32])> {
                vec![$((stringify!($field), self.$field.as_slice()),)+]
            }
        }
    };
}

rows! {
    /// Straight, even walking forwards: one value for each stretch of 1.2 s, about a stride.
    WalkingStyle {
        /// Speed of the pelvis along the way, m/s.
        speed_m_per_s,
        /// Range of the neck beside the way, what a straight line does not explain of it, cm.
        neck_sideways_cm,
        /// Range of the head's height, cm.
        head_bob_cm,
        /// The same seen from the pelvis, cm.
        head_up_cm,
        /// Range of the angle between the line of the shoulders and that of the hips, seen from above, degrees.
        shoulders_degrees,
        /// Range of the pelvis's facing, degrees.
        pelvis_degrees,
        /// Mean pitch of the head against its rest, degrees; down is negative.
        head_pitch_degrees,
        /// Range of a wrist along the way seen from the pelvis, mean of both, cm.
        wrist_fore_aft_cm,
        /// Range of a wrist sideways in the pelvis's frame, mean of both, cm.
        wrist_sideways_cm,
        /// The same of the elbows, cm.
        elbow_sideways_cm,
        /// Standard deviation of the head's speed, cm/s.
        head_speed_sd_cm_per_s,
        /// The same of the neck, cm/s.
        neck_speed_sd_cm_per_s,
        /// The same of the shoulders, mean of both, cm/s.
        shoulder_speed_sd_cm_per_s,
        /// Range of the neck fore and aft in the pelvis's frame, cm.
        neck_fore_aft_cm,
        /// Range of a knee's height seen from the pelvis, mean of both, cm.
        knee_up_cm,
        /// Mean lean of the trunk forwards, degrees.
        trunk_lean_degrees,
    }
}

rows! {
    /// The way on foot as a whole: one value a motion.
    WayStyle {
        /// Standard deviation over mean of the pelvis's speed, a mean of five frames, while it is over 0.3 m/s.
        speed_variation,
        /// The fastest turn of the pelvis, a mean of five frames, degrees a second.
        fastest_turn_degrees_per_s,
        /// How far the head is turned further than the pelvis in turns over 45°/s, their median, degrees.
        head_leads_degrees,
    }
}

rows! {
    /// The first step out of standing: one value a motion that begins so.
    StartStyle {
        /// How far the pelvis has moved towards the standing foot as the other one leaves, cm.
        weight_shift_cm,
        /// How long before that it set off, seconds.
        shift_s,
    }
}

rows! {
    /// Sitting down: one value a sit. It begins as the pelvis has sunk by a twentieth of its way and ends at 95 %.
    DescentStyle {
        /// Range of the pelvis's facing in the 2.5 s before, degrees.
        turn_before_degrees,
        /// The longest time within the 2.5 s before in which someone who has walked moves the pelvis slower than 10 cm/s, seconds.
        still_before_s,
        /// How long the descent takes, seconds.
        descent_s,
        /// The most that the trunk leans forwards on the way down, degrees.
        lean_degrees,
        /// How long before the descent begins the trunk has leant by 10°, seconds; negative where it leans later.
        lean_leads_s,
        /// How much of the way down is behind the pelvis as the trunk leans most, per cent.
        sunk_at_lean_percent,
        /// The trunk's lean as the descent ends, degrees.
        lean_at_seat_degrees,
        /// The most that an upper arm is lifted from hanging, meanwhile and in the third of a second after, degrees.
        upper_arm_degrees,
        /// The fastest that the pelvis sinks, a mean of three frames, m/s.
        fastest_sink_m_per_s,
        /// How far the foot that moves more gets on the floor from where it was as the descent began, cm.
        feet_move_cm,
        /// Range of the pelvis's facing during the descent, degrees.
        pelvis_turns_degrees,
    }
}

rows! {
    /// Sitting: one value for each stretch; speeds of those of a third of a second or more.
    SeatedStyle {
        /// The trunk's lean in the middle of the stretch, degrees; negative leans back.
        trunk_degrees,
        /// How far one ankle is before the other, cm.
        feet_fore_aft_cm,
        /// How far the ankles are apart on the floor plane, cm.
        ankles_apart_cm,
        /// How far the knees are apart, cm.
        knees_apart_cm,
        /// Mean speed of the wrists, cm/s.
        wrists_cm_per_s,
        /// The same of the head, cm/s.
        head_cm_per_s,
        /// The same of the knees, cm/s.
        knees_cm_per_s,
    }
}

rows! {
    /// Getting up: one value for each.
    RisingStyle {
        /// How long the pelvis rises, from a twentieth of its way to 95 %, seconds.
        rise_s,
        /// The most that the trunk leans forwards, degrees.
        lean_degrees,
    }
}

/// How a person walks, sets off, sits down, sits and gets up.
///
/// [`StyleFigures`] are medians, none where the motion shows nothing of the kind; [`StyleValues`] all that they are of.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Style<T = Option<f32>> {
    /// Straight, even walking.
    pub walking: WalkingStyle<T>,
    /// The way on foot as a whole.
    pub way: WayStyle<T>,
    /// The first step out of standing.
    pub start: StartStyle<T>,
    /// Sitting down.
    pub descent: DescentStyle<T>,
    /// Sitting.
    pub seated: SeatedStyle<T>,
    /// Getting up.
    pub rising: RisingStyle<T>,
}

/// The medians.
pub type StyleFigures = Style<Option<f32>>;
/// All values.
pub type StyleValues = Style<Vec<f32>>;

impl StyleValues {
    /// Of a motion on a floor `floor` metres high, of which `segments` say what happens in it: where one walks and stands, sits
    /// down, sits and gets up. Without any all of it is on foot.
    pub fn of(motion: &Motion, floor: f32, segments: &[Segment]) -> Self {
        let poses: Vec<Pose> = motion.postures.iter().map(Posture::pose).collect();
        let on_foot: Vec<bool> = (0..poses.len())
            .map(|frame| {
                let label = segments.iter().find(|s| (s.first..s.end).contains(&frame)).map(|s| s.label);
                let elsewhere = matches!(label, Some(ActionLabel::Other | ActionLabel::SeatedIdle));
                !elsewhere && poses[frame].positions[0].z - floor > STANDING
            })
            .collect();
        let mut out = Self::default();
        out.walk(&poses, &on_foot);
        out.sit(&poses, segments);
        out
    }

    /// With those of `other` after these.
    pub fn merge(&mut self, other: Self) {
        self.walking.merge(other.walking);
        self.way.merge(other.way);
        self.start.merge(other.start);
        self.descent.merge(other.descent);
        self.seated.merge(other.seated);
        self.rising.merge(other.rising);
    }

    /// The median of each row.
    pub fn medians(&self) -> StyleFigures {
        Style {
            walking: self.walking.medians(),
            way: self.way.medians(),
            start: self.start.medians(),
            descent: self.descent.medians(),
            seated: self.seated.medians(),
            rising: self.rising.medians(),
        }
    }

    /// Each row with its group, its name and its values.
    pub fn rows(&self) -> Vec<(&'static str, &'static str, &[f32])> {
        let groups = [
            ("walking", self.walking.rows()),
            ("way", self.way.rows()),
            ("start", self.start.rows()),
            ("descent", self.descent.rows()),
            ("seated", self.seated.rows()),
            ("rising", self.rising.rows()),
        ];
        let named = |(group, rows): (&'static str, Vec<(&'static str, _)>)| {
            rows.into_iter().map(move |(name, values)| (group, name, values))
        };
        groups.into_iter().flat_map(named).collect()
    }
}

impl MotionLibrary {
    /// Style of the clips, mirrored copies left out; of one source alone where one is given.
    pub fn style(&self, source: Option<Source>) -> StyleValues {
        let mut all = StyleValues::default();
        for clip in self.clips.iter().filter(|clip| !clip.mirrored && source.is_none_or(|s| clip.source == s))
        {
            all.merge(StyleValues::of(&clip.motion, 0.0, &clip.segments));
        }
        all
    }
}

fn median(values: &[f32]) -> Option<f32> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f32::total_cmp);
    sorted.get(sorted.len() / 2).copied()
}

/// A trunk's lean from upright towards where the pelvis faces, degrees.
fn lean(pose: &Pose) -> f32 {
    let trunk = pose.position(Joint::Neck) - pose.position(Joint::Hips);
    trunk.dot(facing(pose)).atan2(trunk.z).to_degrees()
}

fn facing(pose: &Pose) -> glam::Vec3 {
    glam::Quat::from_rotation_z(hips_yaw(pose)) * glam::Vec3::NEG_Y
}

/// Yaw of the line between the hips, radians.
fn hips_yaw(pose: &Pose) -> f32 {
    yaw_across(pose, Joint::LeftUpLeg, Joint::RightUpLeg)
}

fn yaw_across(pose: &Pose, left: Joint, right: Joint) -> f32 {
    let across = pose.position(left) - pose.position(right);
    across.y.atan2(across.x)
}

/// How far the hips' facing ranges, degrees.
fn turned(poses: &[Pose]) -> f32 {
    let mut yaw = 0.0;
    let steps = poses.windows(2).map(|pair| {
        yaw += wrap_angle(hips_yaw(&pair[1]) - hips_yaw(&pair[0]));
        yaw
    });
    range(std::iter::once(0.0).chain(steps)).to_degrees()
}

fn range(values: impl Iterator<Item = f32>) -> f32 {
    let (least, most) = values.fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    (most - least).max(0.0)
}

fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len().max(1) as f32
}

fn deviation(values: &[f32]) -> f32 {
    let mean = mean(values);
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / values.len().max(1) as f32).sqrt()
}

/// Mean speeds of the pelvis, planar or in space, from each frame to that `frames` later, m/s.
fn speeds(poses: &[Pose], frames: usize, planar: bool) -> Vec<f32> {
    let way = |pair: &[Pose]| {
        let way = pair[frames].positions[0] - pair[0].positions[0];
        if planar { way.truncate().length() } else { way.length() }
    };
    poses.windows(frames + 1).map(|pair| way(pair) * FRAME_RATE / frames as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_without_values_are_none() {
        let mut values = StyleValues::default();
        values.seated.add(SeatedStyle { trunk_degrees: Some(-5.0), ..Default::default() });
        let mut other = StyleValues::default();
        for degrees in [-9.0, -20.0] {
            other.seated.add(SeatedStyle { trunk_degrees: Some(degrees), ..Default::default() });
        }
        values.merge(other);
        let medians = values.medians();
        assert_eq!((medians.seated.trunk_degrees, medians.seated.knees_apart_cm), (Some(-9.0), None));
        assert_eq!(medians.walking, WalkingStyle::default());
        let rows = values.rows();
        let row = rows.iter().find(|(group, name, _)| (*group, *name) == ("seated", "trunk_degrees"));
        assert_eq!(row.map(|row| row.2), Some([-5.0, -9.0, -20.0].as_slice()));
        // Each row once.
        let mut names: Vec<_> = rows.iter().map(|(group, name, _)| (group, name)).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), rows.len());
    }
}
