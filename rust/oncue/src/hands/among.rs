//! Things of one of several people: what nobody else takes, and how deep one is in somebody who does not carry it.

use rayon::prelude::*;

use super::CarriedThing;
use super::things::Placement;
use crate::anatomy::{BodyPart, DEEP, body_capsules};
use crate::cue::{Performance, Thing};
use crate::error::{Error, Result};
use crate::figures::{Span, Spans};
use crate::motion::Motion;

/// A thing is in nobody whose pelvis is farther away than this beyond its own size, metres.
const FAR: f32 = 1.5;

/// What can be known of things of several people before anything is played: no two take the same one.
///
/// # Errors
/// `Input`, naming both and the thing.
pub(crate) fn check_owners(performances: &[Performance]) -> Result<()> {
    for (at, one) in performances.iter().enumerate() {
        for other in &performances[..at] {
            let both = one.things.iter().find(|thing| other.things.iter().any(|its| its.name == thing.name));
            if let Some(thing) = both {
                return Err(Error::input(format!(
                    "‘{}’ and ‘{}’ both take ‘{}’, and nothing is handed over; have it taken by one of them.",
                    other.start.name, one.start.name, thing.name
                )));
            }
        }
    }
    Ok(())
}

/// Where a thing is in others, of a shot of so many frames: as it stands until it is taken, as it is carried, and as it stands after
/// that. Who is done stays. Of each which of the others and which part, beyond what flesh gives, metres; the deepest first.
pub(crate) fn in_others(
    thing: &Thing,
    carried: &[CarriedThing],
    others: &[&Motion],
    frames: usize,
) -> Vec<Span<(usize, BodyPart), ()>> {
    let (own, size) = (thing.own(), (thing.high - thing.low).length());
    let placement = |frame: usize| {
        let last = carried.iter().rev().find(|c| c.name == thing.name && c.first_frame <= frame);
        last.map_or_else(
            || thing.placement(),
            |c| {
                let i = (frame - c.first_frame).min(c.positions.len() - 1);
                Placement { position: c.positions[i], rotation: c.rotations[i] }
            },
        )
    };
    let touches = |frame: usize| -> Vec<(usize, BodyPart, f32)> {
        let at = placement(frame);
        let near = others.iter().enumerate().filter_map(|(other, motion)| {
            let posture = &motion.postures[frame.min(motion.len() - 1)];
            (posture.root_position.distance(at.position) < FAR + size).then(|| (other, posture.pose()))
        });
        near.flat_map(|(other, pose)| body_capsules(&pose).map(|(part, capsule)| (other, part, capsule)))
            .map(|(other, part, capsule)| (other, part, own.depth(&at, &capsule) - part.gives()))
            .filter(|(_, _, depth)| *depth > DEEP)
            .collect()
    };
    let all: Vec<_> = (0..frames).into_par_iter().map(touches).collect();
    let mut spans = Spans::<(usize, BodyPart), ()>::default();
    for (frame, found) in all.into_iter().enumerate() {
        for (other, part, depth) in found {
            spans.add(frame, (other, part), depth, ());
        }
    }
    spans.worst_first()
}
