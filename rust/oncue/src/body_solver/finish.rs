//! The finishing pass: takes what the latent optimization leaves, by a smooth and damped correction.
//!
//! One least-squares problem over a whole span of frames, solved by Gauss-Newton steps: every frame's correction is
//! damped, its second difference over time is damped too, and the terms (constraints, planted feet, floor, seat) pull at
//! it. The balance of the two dampings makes a correction fade over [`FADE_FRAMES`] frames around what asks for it: never a
//! snap, and where nothing asks it is zero. The paper has no such pass, and misses its constraints by centimetres.

use super::banded::BandedMatrix;
use super::degrees::{BasePosture, DegreesOfFreedom};
use super::term::{FoundTerms, Term, rows};
use crate::error::Result;
use crate::motion::{Pose, Posture};
use crate::progress::Progress;

/// Frames over which a correction fades.
pub(crate) const FADE_FRAMES: f64 = 7.0;
/// Most Gauss-Newton steps.
const MOST_STEPS: usize = 40;
/// No σ is smaller at first than this share of the largest miss, and each step it is allowed to be this much smaller:
/// a stiff valley is hard to follow from afar.
const FIRST_SLACK: f64 = 0.1;
const LESS_SLACK: f64 = 0.45;
/// Slack that no longer matters.
const NO_SLACK: f64 = 2e-5;
/// Done when no number changes more (radians or metres), or when a step gains less than this share of the cost.
const SETTLED_STEP: f64 = 2e-4;
const LEAST_GAIN: f64 = 1e-4;
/// With more damping than this no step would be seen: the correction stays as it is.
const MOST_DAMPING: f64 = 1e8;
/// A single step turns no joint further, radians.
const MOST_STEP: f64 = 0.5;
/// A row with a larger 1/σ than this is a demand, any other a wish.
const DEMAND_WEIGHT: f64 = 300.0;
/// σ of a joint beyond its limit, radians.
const LIMIT_SIGMA: f64 = 0.002;

/// A span of frames to be corrected.
pub(crate) struct Span<'a> {
    pub postures: &'a [Posture],
    /// Whether the motion goes on before and after the span: the correction then starts and ends there without a kink.
    pub joins: [bool; 2],
    pub degrees: &'a DegreesOfFreedom,
    /// For each frame.
    pub terms: &'a [Vec<Term>],
    /// What the body runs into, looked for anew at each step.
    pub found: Option<&'a dyn FoundTerms>,
    /// Frames over which a correction fades; [`FADE_FRAMES`], or 0 for each frame by itself.
    pub spread: f64,
}

/// The corrected postures of a span.
///
/// # Errors
/// `Cancelled`.
pub(crate) fn correct(span: &Span, progress: &Progress) -> Result<Vec<Posture>> {
    let (frames, n) = (span.postures.len(), span.degrees.count());
    let ready: Vec<BasePosture> = span.postures.iter().map(|p| span.degrees.frame(p)).collect();
    let mut x = vec![0.0f64; frames * n];
    let mut system = System::new(span);
    let mut damping = 0.0f64;
    let mut terms = span.terms.to_vec();
    for step in 0..MOST_STEPS {
        progress.check()?;
        if let Some(found) = span.found {
            let poses: Vec<Pose> = posed(span, &ready, &x).map(|posture| posture.pose()).collect();
            for (f, list) in terms.iter_mut().enumerate() {
                list.truncate(span.terms[f].len());
                found.terms(f, &poses, list);
            }
        }
        if step == 0 {
            system.slack = FIRST_SLACK * system.largest_miss(span, &ready, &terms, &x);
        }
        let before = system.assemble(span, &ready, &terms, &x);
        let mut settled = true;
        loop {
            progress.check()?;
            if damping > MOST_DAMPING {
                break;
            }
            let Some(step) = system.step(damping, n) else {
                damping = (damping * 10.0).max(1e-2);
                continue;
            };
            let tried: Vec<f64> = x.iter().zip(&step).map(|(x, s)| x + s).collect();
            let after = system.cost(span, &ready, &terms, &tried);
            if after <= before * (1.0 + 1e-9) {
                let largest = step.iter().fold(0.0f64, |a, s| a.max(s.abs()));
                settled = largest < SETTLED_STEP
                    || (before - after < LEAST_GAIN * before && largest < 50.0 * SETTLED_STEP);
                x = tried;
                damping = if damping < 1e-3 { 0.0 } else { damping * 0.1 };
                break;
            }
            damping = (damping * 10.0).max(1e-2);
        }
        if settled && system.slack < NO_SLACK {
            break;
        }
        system.slack = if system.slack < NO_SLACK { 0.0 } else { LESS_SLACK * system.slack };
    }
    Ok(posed(span, &ready, &x).collect())
}

/// The postures of a span corrected by `x`.
fn posed<'a>(span: &'a Span, ready: &'a [BasePosture], x: &'a [f64]) -> impl Iterator<Item = Posture> + 'a {
    ready.iter().zip(x.chunks_exact(span.degrees.count())).map(|(frame, x)| span.degrees.corrected(frame, x))
}

/// H·step = -g of the whole span.
struct System {
    stiffness: Vec<f64>,
    hessian: BandedMatrix,
    factor: BandedMatrix,
    gradient: Vec<f64>,
    smoothing: f64,
    frames: usize,
    /// The least σ that counts now, metres or radians.
    slack: f64,
}

impl System {
    fn new(span: &Span) -> Self {
        let (frames, n) = (span.postures.len(), span.degrees.count());
        let smoothing = span.spread.powi(4);
        let band = if smoothing > 0.0 { 3 * n - 1 } else { n - 1 };
        let hessian = BandedMatrix::zeros(frames * n, band.min(frames * n - 1));
        Self {
            stiffness: span.degrees.stiffness(),
            factor: hessian.clone(),
            hessian,
            gradient: vec![0.0; frames * n],
            smoothing,
            frames,
            slack: 0.0,
        }
    }

    /// 1/σ of a row or a limit, as far as it counts now.
    fn weight(&self, weight: f64) -> f64 {
        1.0 / self.slack.max(1.0 / weight)
    }

    /// Of all rows that matter more than a wish, metres or radians.
    fn largest_miss(&self, span: &Span, ready: &[BasePosture], terms: &[Vec<Term>], x: &[f64]) -> f64 {
        let n = self.stiffness.len();
        let mut largest = 0.0f64;
        for (f, frame) in ready.iter().enumerate() {
            let posture = span.degrees.corrected(frame, &x[f * n..(f + 1) * n]);
            let pose = posture.pose();
            for term in &terms[f] {
                rows(term, &posture, &pose, |row| {
                    if row.weight > DEMAND_WEIGHT {
                        largest = largest.max(row.miss.abs());
                    }
                });
            }
        }
        largest
    }

    /// Second differences of frames `t-1, t, t+1`; beyond a joined end the correction is zero.
    fn differences<'a>(&self, span: &'a Span) -> impl Iterator<Item = [Option<usize>; 3]> + use<'a> {
        let (frames, smooth) = (self.frames as i64, self.smoothing > 0.0);
        let inside = move |t: i64| (t >= 0 && t < frames).then_some(t as usize);
        (-1..=frames).filter(move |_| smooth).filter_map(move |t| {
            let window = [inside(t - 1), inside(t), inside(t + 1)];
            let free = (t - 1 < 0 && !span.joins[0]) || (t + 1 >= frames && !span.joins[1]);
            (!free && window.iter().any(Option::is_some)).then_some(window)
        })
    }

    /// ½ of the sum of squares at `x`.
    fn cost(&self, span: &Span, ready: &[BasePosture], terms: &[Vec<Term>], x: &[f64]) -> f64 {
        let n = self.stiffness.len();
        let mut sum = 0.0;
        for (f, frame) in ready.iter().enumerate() {
            let x = &x[f * n..(f + 1) * n];
            sum += x.iter().zip(&self.stiffness).map(|(x, s)| s * x * x).sum::<f64>();
            sum += span
                .degrees
                .beyond_limits(frame, x)
                .map(|b| (b.over * self.weight(1.0 / LIMIT_SIGMA)).powi(2))
                .sum::<f64>();
            let pose = span.degrees.corrected(frame, x).pose();
            let posture = &span.degrees.corrected(frame, x);
            for term in &terms[f] {
                rows(term, posture, &pose, |row| {
                    sum += (row.miss * self.weight(row.weight)).powi(2);
                });
            }
        }
        for window in self.differences(span) {
            for (i, stiffness) in self.stiffness.iter().enumerate() {
                let d = second_difference(&window, x, n, i);
                sum += self.smoothing * stiffness * d * d;
            }
        }
        0.5 * sum
    }

    /// Fills H and g at `x`; gives the cost there.
    fn assemble(&mut self, span: &Span, ready: &[BasePosture], terms: &[Vec<Term>], x: &[f64]) -> f64 {
        let n = self.stiffness.len();
        self.hessian.clear();
        self.gradient.fill(0.0);
        let (mut columns, mut row) = (Vec::new(), vec![0.0f64; n]);
        let slack = self.slack;
        for (f, frame) in ready.iter().enumerate() {
            let (base, x) = (f * n, &x[f * n..(f + 1) * n]);
            for (i, stiffness) in self.stiffness.iter().enumerate() {
                *self.hessian.at(base + i, base + i) += stiffness;
                self.gradient[base + i] += stiffness * x[i];
            }
            let limit = self.weight(1.0 / LIMIT_SIGMA);
            for beyond in span.degrees.beyond_limits(frame, x) {
                for i in 0..beyond.size {
                    let scaled = beyond.direction[i] * limit * limit;
                    self.gradient[base + beyond.first + i] += scaled * beyond.over;
                    for j in 0..=i {
                        let at = base + beyond.first;
                        *self.hessian.at(at + i, at + j) += scaled * beyond.direction[j];
                    }
                }
            }
            let posture = span.degrees.corrected(frame, x);
            let pose = posture.pose();
            span.degrees.columns(frame, x, &pose, &mut columns);
            for term in &terms[f] {
                rows(term, &posture, &pose, |r| {
                    r.derivative(&columns, &pose, &mut row);
                    let weight = 1.0 / slack.max(1.0 / r.weight);
                    let miss = r.miss * weight;
                    for i in 0..n {
                        if row[i] == 0.0 {
                            continue;
                        }
                        let scaled = row[i] * weight;
                        self.gradient[base + i] += scaled * miss;
                        for (h, other) in self.hessian.row_from(base + i, base).iter_mut().zip(&row) {
                            *h += scaled * weight * other;
                        }
                    }
                });
            }
        }
        for window in self.differences(span) {
            for i in 0..n {
                let weight = self.smoothing * self.stiffness[i];
                let d = second_difference(&window, x, n, i);
                for (a, ca) in window.iter().zip(DIFFERENCE) {
                    let Some(a) = a else { continue };
                    self.gradient[a * n + i] += weight * ca * d;
                    for (b, cb) in window.iter().zip(DIFFERENCE) {
                        let Some(b) = b else { continue };
                        if b <= a {
                            *self.hessian.at(a * n + i, b * n + i) += weight * ca * cb;
                        }
                    }
                }
            }
        }
        self.cost(span, ready, terms, x)
    }

    /// The step for a damping of `damping` times the stiffness, no longer than [`MOST_STEP`] in any number.
    fn step(&mut self, damping: f64, n: usize) -> Option<Vec<f64>> {
        self.factor.clone_from(&self.hessian);
        for i in 0..self.gradient.len() {
            *self.factor.at(i, i) += damping * self.stiffness[i % n];
        }
        if !self.factor.factorize() {
            return None;
        }
        let mut step: Vec<f64> = self.gradient.iter().map(|g| -g).collect();
        self.factor.solve(&mut step);
        let largest = step.iter().fold(0.0f64, |a, s| a.max(s.abs()));
        if largest > MOST_STEP {
            step.iter_mut().for_each(|s| *s *= MOST_STEP / largest);
        }
        Some(step)
    }
}

const DIFFERENCE: [f64; 3] = [1.0, -2.0, 1.0];

fn second_difference(window: &[Option<usize>; 3], x: &[f64], n: usize, i: usize) -> f64 {
    window.iter().zip(DIFFERENCE).filter_map(|(t, c)| t.map(|t| c * x[t * n + i])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rotation::from_angle_axis;
    use crate::motion::Joint;
    use glam::{Quat, Vec2, Vec3};
    use proptest::prelude::*;

    fn bent(seed: &[f32]) -> Posture {
        let mut posture = Posture::default();
        for (rotation, v) in posture.rotations.iter_mut().zip(seed.chunks_exact(3)) {
            *rotation = from_angle_axis(Vec3::new(v[0], v[1], v[2]));
        }
        posture
    }

    proptest! {
        #[test]
        fn the_gradient_is_that_of_the_cost(seed in prop::collection::vec(-0.4f32..0.4, 66), x in prop::collection::vec(-0.1f64..0.1, 200)) {
            // Hinges well within their limits, so that no finite difference crosses one.
            let mut posture = bent(&seed);
            for (joint, bend) in [(Joint::LeftLeg, 0.8), (Joint::RightLeg, 0.8), (Joint::LeftToe, -0.3), (Joint::RightToe, -0.3)] {
                posture.rotations[joint.index()] = Quat::from_rotation_x(bend);
            }
            posture.rotations[Joint::RightForeArm.index()] = Quat::from_rotation_z(0.8);
            posture.rotations[Joint::LeftForeArm.index()] = Quat::from_rotation_z(-0.8);
            let postures = [posture; 3];
            let degrees = DegreesOfFreedom::for_joints(&[Joint::RightHand], &[]);
            let hand = Joint::RightHand;
            let terms = vec![vec![
                Term::Point { joint: hand, offset: Vec3::X * 0.1, target: Vec3::new(-0.3, -0.3, 1.2), sigma: Vec3::new(0.1, 0.2, 0.3) },
                Term::Facing { yaw: 0.3, sigma: 0.2 },
                Term::Plane { joint: Joint::LeftFoot, offset: Vec3::ZERO, normal: Vec3::Z, least: 1.2, sigma: 0.1 },
                Term::Balance { target: Vec2::new(0.2, 0.1), sigma: 0.2, most: 9.0 },
            ]; 3];
            let span = Span { postures: &postures, joins: [true, false], degrees: &degrees, terms: &terms, found: None, spread: 1.5 };
            let ready: Vec<BasePosture> = postures.iter().map(|p| degrees.frame(p)).collect();
            let mut system = System::new(&span);
            let x: Vec<f64> = (0..3 * degrees.count()).map(|i| x[i % x.len()]).collect();
            let cost = system.assemble(&span, &ready, &terms, &x);
            prop_assert!((cost - system.cost(&span, &ready, &terms, &x)).abs() < 1e-9);
            for i in 0..x.len() {
                let h = 2e-3;
                let at = |h: f64| {
                    let mut moved = x.clone();
                    moved[i] += h;
                    system.cost(&span, &ready, &terms, &moved)
                };
                let numeric = (at(h) - at(-h)) / (2.0 * h);
                prop_assert!((numeric - system.gradient[i]).abs() < 0.02 * (1.0 + numeric.abs()), "{i}: {numeric} {}", system.gradient[i]);
            }
        }
    }

    /// Whatever is asked: where no matrix can be factorized, and where no step makes it better.
    #[test]
    fn what_has_no_solution_comes_to_an_end() {
        let hand = Joint::LeftHand;
        let to = |target: Vec3, sigma: f32| Term::Point {
            joint: hand,
            offset: Vec3::ZERO,
            target,
            sigma: Vec3::splat(sigma),
        };
        let plane =
            |least: f32| Term::Plane { joint: hand, offset: Vec3::ZERO, normal: Vec3::Z, least, sigma: 1e-3 };
        let asked = [
            to(Vec3::NAN, 3e-4),
            to(Vec3::INFINITY, 3e-4),
            to(Vec3::splat(3e38), 3e-4),
            to(Vec3::splat(1e30), 1e-30),
            to(Vec3::ZERO, 0.0),
            to(Vec3::ZERO, f32::NAN),
            plane(f32::INFINITY),
            plane(f32::NAN),
            plane(3e38),
            Term::Facing { yaw: f32::NAN, sigma: 0.2 },
        ];
        for (number, term) in asked.into_iter().enumerate() {
            let (sender, receiver) = std::sync::mpsc::channel();
            std::thread::spawn(move || {
                let postures = vec![Posture::default(); 9];
                let degrees = DegreesOfFreedom::for_joints(&[hand], &[]);
                let mut terms = vec![Vec::new(); 9];
                terms[4].push(term);
                let span = Span {
                    postures: &postures,
                    joins: [true; 2],
                    degrees: &degrees,
                    terms: &terms,
                    found: None,
                    spread: FADE_FRAMES,
                };
                sender.send(correct(&span, &Progress::new()).map(|postures| postures.len()))
            });
            let ended = receiver.recv_timeout(std::time::Duration::from_secs(20));
            assert!(matches!(ended, Ok(Ok(9))), "{number}: {ended:?}");
        }
    }

    #[test]
    fn a_single_pin_is_met_and_fades_away() {
        let postures = vec![Posture::default(); 61];
        let degrees = DegreesOfFreedom::for_joints(&[Joint::LeftHand], &[]);
        let start = postures[0].pose().position(Joint::LeftHand);
        let target = start + Vec3::new(-0.25, -0.2, -0.1);
        let mut terms = vec![Vec::new(); 61];
        terms[30].push(Term::Point {
            joint: Joint::LeftHand,
            offset: Vec3::ZERO,
            target,
            sigma: Vec3::splat(3e-4),
        });
        let span = Span {
            postures: &postures,
            joins: [true; 2],
            degrees: &degrees,
            terms: &terms,
            found: None,
            spread: FADE_FRAMES,
        };
        let out = correct(&span, &Progress::new()).expect("a correction");
        let hands: Vec<Vec3> = out.iter().map(|p| p.pose().position(Joint::LeftHand)).collect();
        assert!(hands[30].distance(target) < 1e-3, "{}", hands[30].distance(target));
        assert!(hands[0].distance(start) < 0.01 && hands[60].distance(start) < 0.01);
        for f in 1..60 {
            let bend = hands[f - 1] + hands[f + 1] - 2.0 * hands[f];
            assert!(bend.length() < 0.02, "frame {f} snaps: {}", bend.length());
        }
    }
}
