//! Which frames are keyed: the shortest way over spans that are near enough to the motion.

use rayon::prelude::*;

use super::segment::{LONGEST, Segments};

/// What a span costs whose error fills the tolerance, in keys.
const OF_ERROR: f64 = 0.02;
/// What a bent speed costs, in keys for each tolerance a frame.
const OF_KINK: f64 = 0.03;
/// What is spared where a key lies on an extreme or a passing position.
const TELLING: f64 = 0.02;
/// After as many spans that are too far, longer ones are not tried.
const PATIENCE: usize = 3;

/// The frames of a stretch to key, both ends included: few, and where the limb turns or passes rather than beside it.
pub(super) fn fewest(segments: &Segments, from: usize, to: usize) -> Vec<usize> {
    if from == to {
        return vec![from];
    }
    let keyed = segments.keyed(from, to);
    let telling = telling(&segments.speeds(from, to));
    let can_be: Vec<bool> = (from..=to).into_par_iter().map(|frame| segments.can_be_keyed(frame)).collect();
    let spans: Vec<Vec<(usize, f64)>> = (from..to)
        .into_par_iter()
        .map(|first| {
            let bound = keyed[keyed.partition_point(|&frame| frame <= first)];
            spans_of(segments, first, bound, |frame| can_be[frame - from])
        })
        .collect();
    // The cost of the rest of the way from each frame, and the next key.
    let mut rest = vec![(0.0, to); to - from + 1];
    for first in (from..to).rev() {
        let costs = spans[first - from].iter().map(|&(next, cost)| {
            let spared = if next < to && telling[next - from - 1] { TELLING } else { 0.0 };
            (cost - spared + rest[next - from].0, next)
        });
        rest[first - from] = costs.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, first + 1));
    }
    let mut path = vec![from];
    while let Some(&last) = path.last().filter(|&&last| last < to) {
        path.push(rest[last - from].1);
    }
    path
}

/// Where the spans from a frame may end, and what each costs. To the next frame there always is one.
fn spans_of(
    segments: &Segments,
    first: usize,
    bound: usize,
    can_be_keyed: impl Fn(usize) -> bool,
) -> Vec<(usize, f64)> {
    let mut spans = Vec::new();
    let mut failed = 0;
    for length in lengths(bound - first) {
        let next = first + length;
        let both = can_be_keyed(first) && can_be_keyed(next);
        if length > 1 && !both {
            continue;
        }
        let misfit = if both { segments.span(first, next).1 } else { None };
        match misfit {
            Some(misfit) => {
                failed = 0;
                spans.push((next, 1.0 + OF_ERROR * misfit.worst * misfit.worst + OF_KINK * misfit.kink));
            }
            // Nothing is nearer than the motion's own frames.
            None if length == 1 => spans.push((next, 4.0)),
            None => failed += 1,
        }
        if failed > PATIENCE {
            break;
        }
    }
    spans
}

/// The lengths that are tried: all short ones, fewer long ones, and up to the next frame that must be keyed.
fn lengths(bound: usize) -> impl Iterator<Item = usize> {
    let steps = std::iter::successors(Some(1_usize), |length| Some(length + (length / 8).max(1)));
    let longest = bound.min(LONGEST);
    steps.take_while(move |&length| length < longest).chain(std::iter::once(longest))
}

/// Of the frames with these speeds those at which a limb turns or passes: the least and the most of their neighbours.
fn telling(speeds: &[f64]) -> Vec<bool> {
    const AROUND: usize = 2;
    let is_telling = |frame: usize| {
        let near = &speeds[frame.saturating_sub(AROUND)..(frame + AROUND + 1).min(speeds.len())];
        let (least, most) =
            near.iter().fold((f64::MAX, f64::MIN), |(low, high), &s| (low.min(s), high.max(s)));
        most > 1.1 * least && (speeds[frame] == least || speeds[frame] == most)
    };
    (0..speeds.len()).map(is_telling).collect()
}
