use super::*;
use crate::figures::{StyleFigures, StyleValues, body_figures};
use crate::library::Segment;
use crate::motion::skeleton::STANDING_HIPS_HEIGHT;
use crate::scene::SceneIndex;
use crate::seats::Seats;
use crate::test_world::{person, room};
use std::f32::consts::FRAC_PI_2;

const SEAT: f32 = 0.45;

/// Who sits on a stool with the hands on the thighs, knees and ankles 19 cm apart.
fn seated(frames: usize) -> Motion {
    let mut posture = person(Default::default(), SEAT + 0.10, 0.42);
    let mut pose = posture.pose();
    for (side, sign) in [1.0f32, -1.0].into_iter().enumerate() {
        let [_, upper, lower, hand] = ARMS[side];
        posture.rotations[upper.index()] = Quat::from_rotation_y(sign * (FRAC_PI_2 - 0.2));
        posture.rotations[lower.index()] = Quat::from_rotation_z(-sign * 0.8);
        [upper, lower, hand].iter().for_each(|joint| pose.place(&posture, joint.index()));
        let onto = pose.position(LEGS[side][0]) + Vec3::new(0.02 * sign, -0.22, 0.095);
        let ahead = Quat::from_rotation_z(-sign * FRAC_PI_2);
        assert!(reach(&mut posture, &mut pose, [upper, lower, hand], Vec3::Z, onto, ahead, 0.0) < 1e-3);
    }
    assert!(touching(&posture.pose(), 0.003).next().is_none());
    Motion { postures: vec![posture; frames], contacts: vec![[1.0; 2]; frames] }
}

fn standing(frames: usize) -> Motion {
    Motion {
        postures: vec![person(Default::default(), STANDING_HIPS_HEIGHT, 0.0); frames],
        contacts: vec![[1.0; 2]; frames],
    }
}

fn stool() -> SceneIndex {
    room(&[([-0.2, -0.14, 0.0], [0.2, 0.2, SEAT])])
}

fn hold<'a>(
    scene: &'a SceneIndex,
    sits: bool,
    frames: usize,
    seed: u64,
    carried: &'a [(Hand, Range<usize>)],
) -> Hold<'a> {
    let seats = if sits { Seats::taken(0, SEAT) } else { Seats::default() };
    let around = Surroundings { scene, moving: &[], ignore_below: 0.1, seats };
    Hold {
        from: 10,
        frames,
        size: 1.0,
        seed,
        floor: 0.0,
        feet_free: [false; 2],
        carried,
        around,
        goes_on: false,
    }
}

fn alive(motion: &Motion, hold: &Hold) -> Motion {
    let mut out = motion.clone();
    enliven(&mut out, hold, &Progress::new()).expect("not cancelled");
    out
}

/// Seated speeds over ten seconds, from the fourth on.
fn style(motion: &Motion) -> StyleFigures {
    let span = Segment {
        label: crate::ActionLabel::SeatedIdle,
        first: 120,
        end: motion.len(),
        complete: motion.len() - 1,
    };
    StyleValues::of(motion, 0.0, &[span]).medians()
}

fn speed(motion: &Motion, joint: Joint) -> f32 {
    let places: Vec<Vec3> = motion.postures[120..].iter().map(|p| p.pose().position(joint)).collect();
    let way: f32 = places.windows(2).map(|w| w[0].distance(w[1])).sum();
    100.0 * way / (places.len() - 1) as f32 * FRAME_RATE
}

#[test]
fn who_sits_lives_for_as_long_as_asked_on_the_cue_and_on_the_feet() {
    let scene = stool();
    for seed in 0..4 {
        let before = seated(40);
        let asked = hold(&scene, true, 1200, seed, &[]);
        let after = alive(&before, &asked);
        assert_eq!((after.len(), after.contacts.len()), (1200, 1200));
        assert_eq!(after.postures[..10], before.postures[..10]);
        let rest = before.postures[0].pose();
        let mut thighs = 0.0f32;
        for (frame, posture) in after.postures.iter().enumerate() {
            let pose = posture.pose();
            assert_eq!(posture.root_position, before.postures[0].root_position);
            assert!(posture.planar().yaw.abs() < 1e-3, "{}", posture.planar().yaw);
            for joint in [Joint::LeftLeg, Joint::RightLeg] {
                assert!(rest.position(joint).z - pose.position(joint).z < 0.021, "{seed} {frame} {joint:?}");
            }
            for joint in [Joint::LeftFoot, Joint::RightFoot, Joint::LeftToe, Joint::RightToe] {
                let away = pose.position(joint).distance(rest.position(joint));
                assert!(away < 1.5e-3, "{seed} {frame} {joint:?}: {away} m");
            }
            // Hands that rest on thighs stir there and lie there: no farther than a hand's breadth along, never off by 5 cm.
            for (side, hand) in Joint::HANDS.into_iter().enumerate() {
                let moved = pose.position(hand) - rest.position(hand);
                assert!(
                    moved.length() < 0.19 && moved.z > -0.04 && moved.z < 0.10,
                    "{seed} {frame} {side}: {moved}"
                );
                thighs = thighs.max(moved.length());
            }
        }
        assert!(thighs > 0.02, "{thighs}");
        // Calm and never still, in every ten seconds.
        for at in [0, 300, 600] {
            let part = Motion {
                postures: after.postures[at..at + 420].to_vec(),
                contacts: after.contacts[at..at + 420].to_vec(),
            };
            let seated = style(&part).seated;
            let [head, wrists, knees] = [seated.head_cm_per_s, seated.wrists_cm_per_s, seated.knees_cm_per_s]
                .map(|v| v.expect("seated"));
            assert!((0.6..12.0).contains(&head), "{seed} {at}: head {head} cm/s");
            assert!((1.0..11.0).contains(&wrists), "{seed} {at}: wrists {wrists} cm/s");
            assert!((0.3..4.0).contains(&knees), "{seed} {at}: knees {knees} cm/s");
        }
        // Nothing is brought into the body, nothing jumps.
        let (was, is) =
            (body_figures(&before, 0.0, Some(&asked.around)), body_figures(&after, 0.0, Some(&asked.around)));
        assert!(
            is.own_body.deepest_cm <= was.own_body.deepest_cm.max(1.0) + 0.2,
            "{:?} {:?}",
            was.own_body,
            is.own_body
        );
        assert_eq!(is.joint_limits.percent, was.joint_limits.percent, "{:?}", is.joint_limits);
        let poses: Vec<Pose> = after.postures.iter().map(Posture::pose).collect();
        for (frame, w) in poses.windows(3).enumerate() {
            for joint in Joint::ALL {
                let a = (w[0].position(joint) + w[2].position(joint) - 2.0 * w[1].position(joint)).length()
                    * 900.0;
                assert!(a < 7.0, "{seed} {frame} {joint:?}: {a} m/s²");
            }
        }
    }
}

#[test]
fn who_stands_sways_over_the_feet() {
    let scene = room(&[]);
    let before = standing(40);
    let after = alive(&before, &hold(&scene, false, 900, 3, &[]));
    let rest = before.postures[0].pose();
    let mut aside = (0f32, 0f32);
    for posture in &after.postures {
        let pose = posture.pose();
        let moved = posture.root_position - before.postures[0].root_position;
        assert!(moved.truncate().length() < 0.03 && moved.z.abs() < 0.01, "{moved}");
        aside = (aside.0.min(moved.x), aside.1.max(moved.x));
        for joint in [Joint::LeftFoot, Joint::RightFoot, Joint::LeftToe, Joint::RightToe] {
            assert!(pose.position(joint).distance(rest.position(joint)) < 2e-3);
        }
    }
    assert!(aside.1 - aside.0 > 0.01, "{aside:?}");
    assert!(speed(&after, Joint::Head) > 0.8 && speed(&after, Joint::LeftHand) > 0.8);
}

#[test]
fn a_hand_that_follows_a_cue_is_left_to_it() {
    let scene = stool();
    for sits in [true, false] {
        let before = if sits { seated(300) } else { standing(300) };
        let carried = [(Hand::Left, 100..180)];
        let after = alive(&before, &hold(&scene, sits, 300, 5, &carried));
        let rest = before.postures[0].pose();
        for frame in 100..180 {
            let pose = after.postures[frame].pose();
            let away = pose.position(Joint::LeftHand).distance(rest.position(Joint::LeftHand));
            let turned = pose.rotation(Joint::LeftHand).angle_between(rest.rotation(Joint::LeftHand));
            assert!(away < 1.5e-3 && turned < 0.06, "{sits} {frame}: {away} m, {turned} rad");
        }
        let moves = |joint: Joint| {
            (200..300)
                .any(|f| after.postures[f].pose().position(joint).distance(rest.position(joint)) > 0.004)
        };
        assert!(moves(Joint::LeftHand) && moves(Joint::Head));
    }
}

#[test]
fn a_seed_is_one_hold_and_no_life_is_none() {
    let scene = stool();
    let before = seated(40);
    let of = |seed: u64| alive(&before, &hold(&scene, true, 300, seed, &[]));
    assert!(of(1) == of(1) && of(1) != of(2));
    let still = alive(&before, &Hold { size: 0.0, ..hold(&scene, true, 300, 1, &[]) });
    assert!(
        still.len() == 300
            && still
                .postures
                .iter()
                .all(|p| p.pose().positions[5].distance(before.postures[0].pose().positions[5]) < 1e-4)
    );
    // A calmer one moves less.
    let calm = alive(&before, &Hold { size: 0.4, ..hold(&scene, true, 300, 1, &[]) });
    assert!(speed(&calm, Joint::Head) < 0.7 * speed(&of(1), Joint::Head));
}

#[test]
fn nobody_leans_into_a_wall() {
    // A wall that the left hand of who stands all but touches.
    let before = standing(40);
    let arm = before.postures[0].pose().position(Joint::LeftHand).x;
    let scene = room(&[([arm + 0.03, -1.0, 0.0], [arm + 0.5, 1.0, 2.0])]);
    let asked = hold(&scene, false, 900, 2, &[]);
    let after = alive(&before, &asked);
    let depth =
        |motion: &Motion| body_figures(motion, 0.0, Some(&asked.around)).scene.expect("a scene").deepest_cm;
    let (was, is) = (depth(&before), depth(&after));
    assert!(is < was.max(0.5) + 0.15, "{was} {is}");
    // Without the wall the same seed goes where it is.
    let open = room(&[]);
    let free = alive(&before, &hold(&open, false, 900, 2, &[]));
    assert!(depth(&free) > 0.6, "{}", depth(&free));
    assert!(speed(&after, Joint::Head) > 0.3);
}

#[test]
fn what_moves_when_a_clip_ends_comes_to_rest() {
    let mut motion = seated(40);
    let spine = Joint::Spine1.index();
    for (frame, posture) in motion.postures.iter_mut().enumerate() {
        posture.rotations[spine] = Quat::from_rotation_x(0.004 * frame as f32);
    }
    lengthen(&mut motion, 100, false);
    let turn = |frame: usize| motion.postures[frame].rotations[spine].to_axis_angle().1;
    let turned: Vec<f32> = (0..99).map(|f| turn(f + 1) - turn(f)).collect();
    assert!(turned.windows(2).all(|w| w[1] <= w[0] + 1e-4 && w[0] - w[1] < 1.2e-3), "{turned:?}");
    assert!((turn(99) - turn(39) - 0.016).abs() < 1e-3 && turned[98].abs() < 1e-4);
}

#[test]
fn takes_settle_each_in_its_own_way() {
    let scene = stool();
    let before = seated(40);
    let ends: Vec<(Motion, Pose)> = (0..5)
        .map(|seed| {
            let asked = Hold { feet_free: [true; 2], ..hold(&scene, true, 45, seed, &[]) };
            let after = alive(&before, &asked);
            let end = after.postures[44].pose();
            (after, end)
        })
        .collect();
    for (i, (motion, end)) in ends.iter().enumerate() {
        for (other, (_, theirs)) in ends.iter().enumerate().skip(i + 1) {
            let apart: f32 =
                (0..22).map(|j| end.positions[j].distance(theirs.positions[j])).sum::<f32>() / 22.0;
            assert!(apart > 0.03, "{i} {other}: {apart} m");
        }
        // The feet stand flat where they stand: in the air on their way, and nowhere else do they move.
        for side in 0..2 {
            let toe = |frame: usize| motion.postures[frame].pose().position(Joint::TOES[side]);
            for frame in 0..44 {
                let stands = motion.contacts[frame][side] == 1.0 && motion.contacts[frame + 1][side] == 1.0;
                assert!(!stands || toe(frame).distance(toe(frame + 1)) < 2e-3, "{i} {side} {frame}");
            }
            assert!((toe(44).z - toe(0).z).abs() < 1e-3);
            let knee = |frame: usize| motion.postures[frame].pose().position(LEGS[side][1]).z;
            assert!(knee(0) - knee(44) < 0.021, "{i} {side}");
        }
        assert_eq!(motion.postures[44].root_position, before.postures[0].root_position);
    }
    let moved = |(motion, end): &(Motion, Pose)| {
        let was = motion.postures[0].pose();
        Joint::TOES.map(|toe| end.position(toe).distance(was.position(toe)))
    };
    assert!(ends.iter().any(|end| moved(end).iter().any(|m| *m > 0.06)));
}

/// Deepest that a motion's body is in the scene, cm.
fn depth(motion: &Motion, hold: &Hold) -> f32 {
    body_figures(motion, 0.0, Some(&hold.around)).scene.expect("a scene").deepest_cm
}

/// How far the trunk leans back at the end, degrees.
fn leans(motion: &Motion) -> f32 {
    let pose = motion.postures[motion.len() - 1].pose();
    let line = pose.position(Joint::Neck) - pose.position(Joint::Spine);
    line.y.atan2(line.z).to_degrees()
}

/// A stool whose back begins so far behind the pelvis, metres.
fn chair(back: f32) -> SceneIndex {
    room(&[([-0.2, -0.14, 0.0], [0.2, 0.2, SEAT]), ([-0.22, back, SEAT], [0.22, back + 0.05, 0.95])])
}

#[test]
fn who_stays_leans_back_until_something_carries_the_trunk() {
    let before = seated(40);
    let leant = [0.18f32, 0.22, 0.26].map(|back| {
        let scene = chair(back);
        let asked = hold(&scene, true, 90, 1, &[]);
        let after = alive(&before, &asked);
        assert!(depth(&after, &asked) < 1.0, "{back}");
        let (end, rest) = (after.postures[89].pose(), before.postures[0].pose());
        assert_eq!(after.postures[89].root_position, before.postures[0].root_position);
        for joint in [Joint::LeftFoot, Joint::RightFoot] {
            assert!(end.position(joint).distance(rest.position(joint)) < 1.5e-3, "{back} {joint:?}");
        }
        // Hands come back with it, on the thighs.
        for hand in Joint::HANDS {
            let moved = end.position(hand) - rest.position(hand);
            assert!(moved.length() < 0.22 && moved.z.abs() < 0.08, "{back} {hand:?} {moved}");
        }
        // The head looks where it did.
        let nods = end.rotation(Joint::Head) * Vec3::NEG_Y;
        assert!(nods.z.abs() < 0.35, "{back} {nods}");
        leans(&after)
    });
    assert!(leant[0] + 4.0 < leant[1] && leant[1] + 4.0 < leant[2] && leant[2] < 36.0, "{leant:?}");
    // The whole trunk goes 20 cm farther back than what is before the pelvis's back: within 3 cm of what carries it.
    let scene = chair(0.22);
    let asked = hold(&scene, true, 90, 1, &[]);
    let nearer = room(&[([-0.22, 0.19, SEAT + 0.2], [0.22, 0.27, 0.95])]);
    let touches = Hold { around: Surroundings { scene: &nearer, ..asked.around.clone() }, ..asked };
    let scene = chair(0.22);
    let after = alive(&before, &hold(&scene, true, 90, 1, &[]));
    assert!(depth(&after, &touches) > 0.5);
    // Other takes sit up, and so does who gets up at once, has something in hand, or has nothing behind.
    for (seed, frames, carried) in [(0, 90, vec![]), (1, 30, vec![]), (1, 90, vec![(Hand::Left, 20..60)])] {
        let scene = chair(0.22);
        let after = alive(&seated(30), &hold(&scene, true, frames, seed, &carried));
        assert!(leans(&after) < leant[1] - 5.0, "{seed} {frames}: {}", leans(&after));
    }
    let far = chair(0.6);
    assert!(leans(&alive(&before, &hold(&far, true, 90, 1, &[]))) < 8.0);
}

#[test]
fn who_reclines_on_nothing_sits_up() {
    let mut before = seated(40);
    for posture in &mut before.postures {
        posture.rotations[Joint::Spine.index()] *= Quat::from_rotation_x(-0.3);
    }
    assert!(leans(&before) > 16.0);
    let scene = stool();
    for seed in 0..5 {
        let after = alive(&before, &hold(&scene, true, 90, seed, &[]));
        assert!(leans(&after) < 10.0, "{seed}: {}", leans(&after));
    }
    // Where there is a back it leans on that, in every take.
    let scene = chair(0.24);
    let asked = hold(&scene, true, 90, 3, &[]);
    let after = alive(&before, &asked);
    assert!(depth(&after, &asked) < depth(&before, &asked).max(1.0));
}

#[test]
fn hands_lie_on_the_arms_of_a_seat() {
    let before = seated(40);
    let armchair = |height: f32| {
        let rest = |sign: f32| {
            let (a, b) = (sign * 0.27, sign * 0.37);
            ([a.min(b), -0.40, 0.0], [a.max(b), 0.2, SEAT + height])
        };
        room(&[([-0.26, -0.14, 0.0], [0.26, 0.2, SEAT]), rest(1.0), rest(-1.0)])
    };
    let lies = |motion: &Motion, height: f32| {
        let pose = motion.postures[motion.len() - 1].pose();
        Joint::HANDS.map(|hand| {
            let at = pose.position(hand);
            (0.26..0.38).contains(&at.x.abs()) && (0.03..0.07).contains(&(at.z - SEAT - height))
        })
    };
    let scene = armchair(0.22);
    for (seed, expected) in [(0, [false; 2]), (1, [true; 2]), (2, [false, true]), (3, [true, false])] {
        let asked = hold(&scene, true, 90, seed, &[]);
        let after = alive(&before, &asked);
        assert_eq!(lies(&after, 0.22), expected, "{seed}");
        assert!(depth(&after, &asked) < 1.0, "{seed}");
        assert!(body_figures(&after, 0.0, None).joint_limits.percent < 1e-3, "{seed}");
        let poses: Vec<Pose> = after.postures.iter().map(Posture::pose).collect();
        for w in poses.windows(3) {
            for joint in Joint::HANDS {
                let a = (w[0].position(joint) + w[2].position(joint) - 2.0 * w[1].position(joint)).length();
                assert!(a * 900.0 < 12.0, "{seed} {joint:?}: {} m/s²", a * 900.0);
            }
        }
    }
    // Too high, and not there.
    for scene in [armchair(0.45), stool()] {
        let after = alive(&before, &hold(&scene, true, 90, 1, &[]));
        assert_eq!(lies(&after, 0.22), [false; 2]);
    }
}
