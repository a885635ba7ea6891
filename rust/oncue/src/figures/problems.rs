//! What of the figures a person would not accept, in words.

use super::{BodyFigures, BodyPart, LimitedTurn, OthersFigures};
use crate::motion::Joint;
use crate::settings::ReportSettings;

/// Of each kind so many are told, the worst first.
const TOLD: usize = 3;

impl BodyFigures {
    /// What is more than a brief touch, in sentences with limb and frames; the worst of each kind first, and how many more
    /// there are.
    pub fn problems(&self, settings: &ReportSettings) -> Vec<String> {
        let [own, scene, joints] = self.objections(settings);
        let mut out = told(own, "more touches of the own body");
        out.extend(told(scene, "more touches of the scene"));
        out.extend(told(joints, "more of elbows and knees"));
        out
    }

    /// All that [`Self::problems`] tells of, however much: of the own body, of the scene, of elbows and knees.
    pub(crate) fn objections(&self, settings: &ReportSettings) -> [Vec<String>; 3] {
        let lasts = |first: usize, end: usize| end - first > settings.brief_frames;
        let deep = |depth_cm: f32| depth_cm > 100.0 * settings.touch_depth;
        let own =
            self.own_body.touches.iter().filter(|t| lasts(t.first, t.end) && deep(t.depth_cm)).map(|t| {
                let [inner, limb] = t.parts;
                format!(
                    "The {} is {:.0} cm deep in the {} ({}).",
                    limb.in_words(),
                    t.depth_cm,
                    inner.in_words(),
                    frames(t.first, t.end)
                )
            });
        let scene = self.scene.iter().flat_map(|s| &s.touches);
        let scene = scene.filter(|t| lasts(t.first, t.end) && deep(t.depth_cm)).map(|t| {
            let [x, y, z] = t.place;
            format!(
                "The {} is {:.0} cm deep in what stands at {x:.2}, {y:.2}, {z:.2} ({}).",
                t.part.in_words(),
                t.depth_cm,
                frames(t.first, t.end)
            )
        });
        let joints =
            self.joint_limits.beyond.iter().filter(|b| {
                is_hinge(b.joint) && lasts(b.first, b.end) && b.degrees > settings.beyond_degrees
            });
        let joints = joints.map(|b| {
            let how = match b.turn {
                LimitedTurn::Hyperextension => "backwards",
                LimitedTurn::Sideways => "sideways",
                _ => "too far",
            };
            format!(
                "The {} is bent {how}, {:.0}° beyond its limit ({}).",
                joint_in_words(b.joint),
                b.degrees,
                frames(b.first, b.end)
            )
        });
        [own.collect(), scene.collect(), joints.collect()]
    }
}

impl OthersFigures {
    /// Where the person is in somebody else, in sentences with limb and frames, the worst first: of two people not even a brief touch
    /// goes unsaid.
    pub fn problems(&self) -> Vec<String> {
        let said = self.touches.iter().map(|t| {
            let [own, theirs] = t.parts;
            format!(
                "The {} is {:.0} cm deep in the {} of ‘{}’ ({}).",
                own.in_words(),
                t.depth_cm.max(1.0),
                theirs.in_words(),
                t.person,
                frames(t.first, t.end)
            )
        });
        told(said.collect(), "more touches of other people")
    }
}

fn told(mut all: Vec<String>, more: &str) -> Vec<String> {
    let left = all.len().saturating_sub(TOLD);
    all.truncate(TOLD);
    if left > 0 {
        all.push(format!("There are {left} {more}."));
    }
    all
}

fn frames(first: usize, end: usize) -> String {
    format!("frames {first} to {}", end.saturating_sub(1))
}

fn is_hinge(joint: Joint) -> bool {
    matches!(joint, Joint::LeftForeArm | Joint::RightForeArm | Joint::LeftLeg | Joint::RightLeg)
}

fn joint_in_words(joint: Joint) -> &'static str {
    match joint {
        Joint::LeftForeArm => "left elbow",
        Joint::RightForeArm => "right elbow",
        Joint::LeftLeg => "left knee",
        _ => "right knee",
    }
}

impl BodyPart {
    /// As a person would call it.
    pub fn in_words(self) -> &'static str {
        use BodyPart::*;
        match self {
            Head => "head",
            Pelvis => "pelvis",
            Trunk => "trunk",
            LeftUpperArm => "left upper arm",
            RightUpperArm => "right upper arm",
            LeftForearm => "left forearm",
            RightForearm => "right forearm",
            LeftHand => "left hand",
            RightHand => "right hand",
            LeftThigh => "left thigh",
            RightThigh => "right thigh",
            LeftShin => "left shin",
            RightShin => "right shin",
            LeftFoot => "left foot",
            RightFoot => "right foot",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::{BeyondLimit, OwnTouch, SceneDepthFigures, SceneTouch};

    fn own(first: usize, end: usize, depth_cm: f32) -> OwnTouch {
        OwnTouch { parts: [BodyPart::Pelvis, BodyPart::LeftForearm], first, end, depth_cm, frame: first }
    }

    #[test]
    fn more_than_a_brief_touch_is_told_with_limb_and_frames() {
        let mut figures = BodyFigures::default();
        let settings = ReportSettings::default();
        assert!(figures.problems(&settings).is_empty());
        // Three frames are brief, four are not; a centimetre is none.
        figures.own_body.touches = vec![own(10, 13, 9.0), own(20, 24, 4.2), own(30, 90, 0.9)];
        assert_eq!(
            figures.problems(&settings),
            ["The left forearm is 4 cm deep in the pelvis (frames 20 to 23)."]
        );
        let touch = |first: usize| SceneTouch {
            part: BodyPart::RightHand,
            first,
            end: first + 5,
            depth_cm: 7.1,
            frame: first,
            place: [1.0, -2.0, 0.76],
        };
        figures.scene =
            Some(SceneDepthFigures { touches: (0..5).map(touch).collect(), ..Default::default() });
        let told = figures.problems(&settings);
        assert_eq!(
            told[1],
            "The right hand is 7 cm deep in what stands at 1.00, -2.00, 0.76 (frames 0 to 4)."
        );
        assert_eq!((told.len(), told[4].as_str()), (5, "There are 2 more touches of the scene."));
        // Who chooses among motions minds each of them.
        assert_eq!(figures.objections(&settings).map(|kind| kind.len()), [1, 5, 0]);
        let lenient = ReportSettings { touch_depth: 0.08, ..settings.clone() };
        assert!(figures.problems(&lenient).is_empty());
    }

    #[test]
    fn an_elbow_bent_backwards_is_told() {
        let mut figures = BodyFigures::default();
        let bent = |joint, degrees| BeyondLimit {
            joint,
            turn: LimitedTurn::Hyperextension,
            first: 2,
            end: 9,
            degrees,
            frame: 5,
        };
        // Of shoulders and hips nothing is said: their ranges are less sure.
        figures.joint_limits.beyond =
            vec![bent(Joint::LeftForeArm, 22.0), bent(Joint::RightLeg, 5.5), bent(Joint::LeftArm, 30.0)];
        assert_eq!(
            figures.problems(&ReportSettings::default()),
            ["The left elbow is bent backwards, 22° beyond its limit (frames 2 to 8)."]
        );
    }
}
