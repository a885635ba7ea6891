//! The curves of a limb from one key to the next, and how far they are from the motion.

use glam::{DQuat, DVec3};

use super::bones::{Channels, ORIGIN, World};
use super::{BoneKeys, Bones, Limb, Limits};

/// The longest span between two keys, frames.
pub(super) const LONGEST: usize = 120;
/// How strongly a handle is drawn to the motion's own slope, in frames of the fit.
const TO_SLOPE: f64 = 0.004;
/// A rotation's channels and the location's.
const MOST_CHANNELS: usize = 7;

type Row = [f64; MOST_CHANNELS];
/// The slopes where no curve is made.
const NONE: Row = [f64::NAN; MOST_CHANNELS];

/// How fast a bone's channels change at the two ends of a span, a frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slopes {
    after: Row,
    before: Row,
}

/// How far the curves of a span are from the motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Misfit {
    /// The largest error, in tolerances.
    pub(super) worst: f64,
    /// How far the speed at the ends is from the motion's, in tolerances a frame.
    pub(super) kink: f64,
}

/// The curves of a limb along a path of keys.
pub(super) struct Spans {
    /// Span by span of each bone; None where its curves stay.
    pub(super) slopes: Vec<Vec<Option<Slopes>>>,
    /// Whether all are within the tolerance.
    pub(super) holds: bool,
}

/// A limb's motion, cut where keys are.
pub(super) struct Segments<'a> {
    bones: &'a Bones,
    pub(super) limb: &'a Limb,
    pub(super) limits: &'a Limits,
    channels: &'a Channels,
    pub(super) truth: &'a World,
    /// Where the bones are that were fitted before.
    played: &'a World,
    /// Of each of the limb's bones the place in the limb of its parent, where that is one of it.
    parents: Vec<Option<usize>>,
    /// Span by span the weights of a cubic's four control values at its half frames.
    weights: Vec<Vec<[f64; 4]>>,
}

impl<'a> Segments<'a> {
    pub(super) fn new(
        bones: &'a Bones,
        limb: &'a Limb,
        limits: &'a Limits,
        channels: &'a Channels,
        truth: &'a World,
        played: &'a World,
    ) -> Self {
        let inside = |bone: &usize| {
            bones.parents[*bone].and_then(|parent| limb.bones.iter().position(|other| *other == parent))
        };
        let weights = (0..=LONGEST.min(channels.frames)).map(bernstein).collect();
        let parents = limb.bones.iter().map(inside).collect();
        Self { bones, limb, limits, channels, truth, played, parents, weights }
    }

    fn is_kept(&self, frame: usize) -> bool {
        self.limb.bones.iter().all(|&bone| self.channels.stays(frame, bone))
    }

    /// First and last frame of each stretch in which some of the limb's curves are to be made.
    pub(super) fn runs(&self) -> Vec<(usize, usize)> {
        let mut runs: Vec<(usize, usize)> = Vec::new();
        if self.channels.frames == 1 && !self.is_kept(0) {
            runs.push((0, 0));
        }
        for frame in (0..self.channels.frames.saturating_sub(1)).filter(|&frame| !self.is_kept(frame)) {
            match runs.last_mut() {
                Some((_, last)) if *last == frame => *last = frame + 1,
                _ => runs.push((frame, frame + 1)),
            }
        }
        runs
    }

    /// The frames of a stretch that are keyed in any case, its ends among them.
    pub(super) fn keyed(&self, from: usize, to: usize) -> Vec<usize> {
        let changes = (from + 1..to).filter(|&frame| {
            let changes =
                |&bone: &usize| self.channels.stays(frame, bone) != self.channels.stays(frame - 1, bone);
            self.limb.keyed.contains(&frame) || self.limb.bones.iter().any(changes)
        });
        std::iter::once(from).chain(changes).chain(std::iter::once(to)).collect()
    }

    /// Whether the limb's pose at a frame is given by curves that stay beside it.
    fn is_seam(&self, frame: usize) -> bool {
        let stays = |frame: usize| self.limb.bones.iter().any(|&bone| self.channels.stays(frame, bone));
        (frame + 1 < self.channels.frames && stays(frame)) || frame.checked_sub(1).is_some_and(stays)
    }

    /// Whether a key at a frame, with the motion's own turns, leaves the limb within the tolerance there: what it hangs on may
    /// be too far off.
    pub(super) fn can_be_keyed(&self, frame: usize) -> bool {
        if self.is_seam(frame) {
            return true;
        }
        let mut pose = Vec::with_capacity(self.limb.bones.len());
        let span = if frame + 1 < self.channels.frames { (frame, frame + 1) } else { (frame - 1, frame) };
        self.pose(span.0, span.1, 2 * frame, &vec![None; self.limb.bones.len()], &mut pose);
        self.limb.bones.iter().zip(&pose).all(|(&bone, (place, _, _))| {
            place.distance(self.truth.placed(2 * frame, bone).0) <= self.limits.tolerances[bone].place
        })
    }

    /// How fast the limb's end moves upon the limb's parent, at each frame of a stretch but its ends.
    pub(super) fn speeds(&self, from: usize, to: usize) -> Vec<f64> {
        let (Some(&first), Some(&last)) = (self.limb.bones.first(), self.limb.bones.last()) else {
            return Vec::new();
        };
        let at = |sample: usize| {
            let (place, turn) = self.bones.parents[first].map_or(ORIGIN, |p| self.truth.placed(sample, p));
            turn.inverse() * (self.truth.placed(sample, last).0 - place)
        };
        (from + 1..to).map(|frame| at(2 * frame + 1).distance(at(2 * frame - 1))).collect()
    }

    fn width(bone: usize) -> usize {
        if bone == 0 { MOST_CHANNELS } else { 4 }
    }

    fn wanted(&self, sample: usize, bone: usize) -> Row {
        let q = self.channels.wanted.rotations[sample * self.channels.bones + bone];
        let l = if bone == 0 { self.channels.wanted.locations[sample] } else { DVec3::ZERO };
        [q.w, q.x, q.y, q.z, l.x, l.y, l.z]
    }

    /// The motion's own slope at a frame.
    fn slope(&self, frame: usize, bone: usize) -> Row {
        let last = 2 * (self.channels.frames - 1);
        let at = |sample: usize| self.wanted(sample, bone);
        let sample = 2 * frame;
        if (2..=last.saturating_sub(2)).contains(&sample) {
            let (near, far) = ((at(sample + 1), at(sample - 1)), (at(sample + 2), at(sample - 2)));
            std::array::from_fn(|c| (8.0 * (near.0[c] - near.1[c]) - (far.0[c] - far.1[c])) / 6.0)
        } else {
            let (a, b) = (at(sample.saturating_sub(1)), at((sample + 1).min(last)));
            let frames = ((sample + 1).min(last) - sample.saturating_sub(1)) as f64 / 2.0;
            std::array::from_fn(|c| if frames > 0.0 { (b[c] - a[c]) / frames } else { 0.0 })
        }
    }

    /// The slopes with which a bone's curves come nearest to the motion between two keys.
    fn nearest(&self, from: usize, to: usize, bone: usize) -> Slopes {
        let third = (to - from) as f64 / 3.0;
        let (first, last) = (self.wanted(2 * from, bone), self.wanted(2 * to, bone));
        let own = Slopes { after: self.slope(from, bone), before: self.slope(to, bone) };
        let weights = &self.weights[to - from];
        let pull = TO_SLOPE * (to - from) as f64;
        let (mut aa, mut ab, mut bb) = (pull, 0.0, pull);
        let (mut ra, mut rb) = ([0.0; MOST_CHANNELS], [0.0; MOST_CHANNELS]);
        let width = Self::width(bone);
        for (k, [w0, w1, w2, w3]) in weights.iter().enumerate() {
            (aa, ab, bb) = (aa + w1 * w1, ab + w1 * w2, bb + w2 * w2);
            let wanted = self.wanted(2 * from + k, bone);
            for c in 0..width {
                let rest = wanted[c] - w0 * first[c] - w3 * last[c];
                ra[c] += w1 * rest;
                rb[c] += w2 * rest;
            }
        }
        let determinant = aa * bb - ab * ab;
        let mut slopes = own;
        for c in 0..width {
            let ya = ra[c] + pull * (first[c] + own.after[c] * third);
            let yb = rb[c] + pull * (last[c] - own.before[c] * third);
            slopes.after[c] = ((bb * ya - ab * yb) / determinant - first[c]) / third;
            slopes.before[c] = (last[c] - (aa * yb - ab * ya) / determinant) / third;
        }
        slopes
    }

    /// The weights of the four control values of a span's cubics at a half frame.
    pub(super) fn weights(&self, from: usize, to: usize, sample: usize) -> [f64; 4] {
        self.weights[to - from][sample - 2 * from]
    }

    /// Whether a bone of the limb carries another, by their places in it.
    pub(super) fn is_over(&self, bone: usize, other: usize) -> bool {
        std::iter::successors(self.parents[other], |&at| self.parents[at]).any(|at| at == bone)
    }

    /// Turns the handles of a bone's curves about its own axes: by a vector after the first key, another before the last.
    pub(super) fn turn_handles(
        &self,
        from: usize,
        to: usize,
        bone: usize,
        slopes: &mut Slopes,
        turns: &[f64],
    ) {
        let third = (to - from) as f64 / 3.0;
        let turned = |frame: usize, turn: &[f64]| {
            let q = self.channels.wanted.rotations[2 * frame * self.channels.bones + bone];
            let by = q * DQuat::from_xyzw(turn[0] / 2.0, turn[1] / 2.0, turn[2] / 2.0, 0.0);
            [by.w, by.x, by.y, by.z]
        };
        let (after, before) = (turned(from, &turns[..3]), turned(to, &turns[3..]));
        for c in 0..4 {
            slopes.after[c] += after[c] / third;
            slopes.before[c] -= before[c] / third;
        }
    }

    /// The slopes of each of the limb's bones between two keys; None for those whose curves stay there.
    pub(super) fn slopes(&self, from: usize, to: usize) -> Vec<Option<Slopes>> {
        let of = |&bone: &usize| (!self.channels.stays(from, bone)).then(|| self.nearest(from, to, bone));
        self.limb.bones.iter().map(of).collect()
    }

    /// The slopes of each span of a path of key frames, as nearly the same on both sides of a key as the tolerance allows.
    pub(super) fn spans(&self, path: &[usize]) -> Spans {
        let fitted = path.windows(2).map(|span| self.span(span[0], span[1]));
        let (mut slopes, misfits): (Vec<_>, Vec<_>) = fitted.unzip();
        for key in 1..slopes.len() {
            for share in [1.0, 0.5] {
                let (left, right) = bent(&slopes[key - 1], &slopes[key], share);
                if self.misfit(path[key - 1], path[key], &left).is_some()
                    && self.misfit(path[key], path[key + 1], &right).is_some()
                {
                    (slopes[key - 1], slopes[key]) = (left, right);
                    break;
                }
            }
        }
        let seam = |span: &[usize]| self.is_seam(span[0]) || self.is_seam(span[1]);
        let holds = path.windows(2).zip(&misfits).all(|(span, misfit)| misfit.is_some() || seam(span));
        Spans { slopes, holds }
    }

    /// The limb's curves between two keys, and how far they are from the motion; None where that is too far.
    pub(super) fn span(&self, from: usize, to: usize) -> (Vec<Option<Slopes>>, Option<Misfit>) {
        let near = self.slopes(from, to);
        let misfit = self.misfit(from, to, &near);
        if misfit.is_some() || to - from < 2 {
            return (near, misfit);
        }
        let refined = self.refined(from, to, &near);
        let misfit = self.misfit(from, to, &refined);
        (refined, misfit)
    }

    /// The limb at a half frame as the curves between two keys play it: head, turn and own rotation of each bone.
    pub(super) fn pose(
        &self,
        from: usize,
        to: usize,
        sample: usize,
        slopes: &[Option<Slopes>],
        out: &mut Vec<(DVec3, DQuat, DQuat)>,
    ) {
        out.clear();
        let third = (to - from) as f64 / 3.0;
        let [w0, w1, w2, w3] = self.weights[to - from][sample - 2 * from];
        for (k, &bone) in self.limb.bones.iter().enumerate() {
            let row = match &slopes[k] {
                None => self.wanted(sample, bone),
                Some(slopes) => {
                    let (first, last) = (self.wanted(2 * from, bone), self.wanted(2 * to, bone));
                    std::array::from_fn(|c| {
                        (w0 + w1) * first[c] + w1 * third * slopes.after[c] + (w2 + w3) * last[c]
                            - w2 * third * slopes.before[c]
                    })
                }
            };
            let local = DQuat::from_xyzw(row[1], row[2], row[3], row[0]).normalize();
            let parent = match (self.parents[k], self.bones.parents[bone]) {
                (Some(inside), _) => (out[inside].0, out[inside].1),
                (None, Some(outside)) => self.played.placed(sample, outside),
                (None, None) => ORIGIN,
            };
            let (place, turn) = self.bones.upon(bone, parent, local, DVec3::new(row[4], row[5], row[6]));
            out.push((place, turn, local));
        }
    }

    /// The keys of the limb's bones along a path of key frames.
    pub(super) fn keys(&self, path: &[usize], spans: &[Vec<Option<Slopes>>]) -> Vec<BoneKeys> {
        self.limb
            .bones
            .iter()
            .enumerate()
            .map(|(k, &bone)| {
                let mut keys = BoneKeys::default();
                let width = Self::width(bone);
                for (index, &frame) in path.iter().enumerate() {
                    let before = index.checked_sub(1).and_then(|span| spans[span][k]);
                    let after = spans.get(index).and_then(|span| span[k]);
                    if before.is_none() && after.is_none() && path.len() > 1 {
                        continue;
                    }
                    keys.frames.push(frame);
                    keys.values.extend_from_slice(&self.wanted(2 * frame, bone)[..width]);
                    keys.before.extend_from_slice(&before.map_or(NONE, |s| s.before)[..width]);
                    keys.after.extend_from_slice(&after.map_or(NONE, |s| s.after)[..width]);
                }
                keys
            })
            .collect()
    }

    /// Head and turn of the limb's bones at the half frames of a path of keys, as its curves play them.
    pub(super) fn play(&self, path: &[usize], spans: &[Vec<Option<Slopes>>]) -> Vec<(DVec3, DQuat)> {
        let mut out = Vec::new();
        let mut pose = Vec::new();
        for (span, slopes) in path.windows(2).zip(spans) {
            // The last sample of a span is the first of the next.
            for sample in 2 * span[0]..2 * span[1] {
                self.pose(span[0], span[1], sample, slopes, &mut pose);
                out.extend(pose.iter().map(|&(place, turn, _)| (place, turn)));
            }
        }
        if let (Some(span), Some(slopes)) = (path.windows(2).last(), spans.last()) {
            self.pose(span[0], span[1], 2 * span[1], slopes, &mut pose);
            out.extend(pose.iter().map(|&(place, turn, _)| (place, turn)));
        }
        out
    }

    /// How far curves between two keys are from the motion; None where that is more than the tolerance.
    pub(super) fn misfit(&self, from: usize, to: usize, slopes: &[Option<Slopes>]) -> Option<Misfit> {
        let mut pose = Vec::with_capacity(self.limb.bones.len());
        let samples = 2 * (to - from);
        let seams = (self.is_seam(from), self.is_seam(to));
        let (mut worst, mut kink) = (0.0_f64, 0.0_f64);
        // The middle first: most spans that are too long fail there.
        let order = (0..=samples).step_by(4).chain((0..=samples).filter(|k| k % 4 != 0));
        let mut errors = vec![DVec3::ZERO; (samples + 1) * self.limb.bones.len()];
        for k in order {
            let sample = 2 * from + k;
            self.pose(from, to, sample, slopes, &mut pose);
            for (index, &bone) in self.limb.bones.iter().enumerate() {
                let (place, _, local) = pose[index];
                let allowed = self.limits.tolerances[bone];
                let error = place - self.truth.placed(sample, bone).0;
                errors[k * self.limb.bones.len() + index] = error;
                let mut far = error.length() / allowed.place;
                if slopes[index].is_some() {
                    far = far.max(angle(local, self.truth.local(sample, bone)) / allowed.turn);
                }
                // What is given at a seam nobody can mend.
                if far > 1.0 && !(k == 0 && seams.0 || k == samples && seams.1) {
                    return None;
                }
                worst = worst.max(far);
            }
        }
        for (index, &bone) in self.limb.bones.iter().enumerate() {
            let at = |k: usize| errors[k * self.limb.bones.len() + index];
            let allowed = self.limits.tolerances[bone].place;
            kink += 2.0 * (at(1).distance(at(0)) + at(samples).distance(at(samples - 1))) / allowed;
            if self.limits.planted.is_empty() {
                continue;
            }
            for k in 0..to - from {
                if self.limits.planted[(from + k) * self.channels.bones + bone] {
                    let drift = at(2 * k + 2).distance(at(2 * k)) / self.limits.drift;
                    if drift > 1.0 {
                        return None;
                    }
                    worst = worst.max(drift);
                }
            }
        }
        Some(Misfit { worst, kink })
    }
}

/// Two spans with the slopes at the key between them brought to their mean by a share of the way.
fn bent(
    left: &[Option<Slopes>],
    right: &[Option<Slopes>],
    share: f64,
) -> (Vec<Option<Slopes>>, Vec<Option<Slopes>>) {
    let (mut left, mut right) = (left.to_vec(), right.to_vec());
    for (before, after) in left.iter_mut().zip(&mut right) {
        let (Some(before), Some(after)) = (before, after) else { continue };
        for c in 0..MOST_CHANNELS {
            let mean = (before.before[c] + after.after[c]) / 2.0;
            before.before[c] += share * (mean - before.before[c]);
            after.after[c] += share * (mean - after.after[c]);
        }
    }
    (left, right)
}

/// The angle between two rotations that are near to each other, radians.
fn angle(a: DQuat, b: DQuat) -> f64 {
    2.0 * (a - b).length().min((a + b).length())
}

/// The weights of a cubic's four control values at the half frames of a span, its ends included.
fn bernstein(span: usize) -> Vec<[f64; 4]> {
    let samples = (2 * span).max(1) as f64;
    let at = |k: usize| {
        let (t, r) = (k as f64 / samples, 1.0 - k as f64 / samples);
        [r * r * r, 3.0 * t * r * r, 3.0 * t * t * r, t * t * t]
    };
    (0..=2 * span).map(at).collect()
}
