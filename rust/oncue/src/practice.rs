//! Rooms made by rule, for optimizing the prior policy and for tests: walls, doors, furniture with seats.
//!
//! A room is no likeness of any real one. What it must have is what a policy meets in scenes: gaps that are just wide
//! enough, chairs half under tables, seats of every height, corners, things that stick out at the height of an arm.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Vec2, Vec2Swizzles, Vec3};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::action::ActionType;
use crate::cue::ActionCue;
use crate::math::planar::rotate;
use crate::motion::skeleton::{REST_HIPS_HEIGHT, SEATED_HIPS_HEIGHT};

/// How often a piece is tried elsewhere before it is left out.
const TRIES: usize = 24;

/// A room: triangles (world, metres, floor at z = 0) and the cues that it offers.
#[derive(Debug, Clone, Default)]
pub struct PracticeRoom {
    /// World, metres.
    pub positions: Vec<Vec3>,
    /// Indices of the positions.
    pub triangles: Vec<[u32; 3]>,
    /// What can be asked for in it.
    pub cues: Vec<ActionCue>,
}

/// A box of a piece: its lower and upper corner in the piece's frame, which faces -Y.
type Part = (Vec3, Vec3);

/// A piece of furniture in its own frame: it stands on the floor round the origin and faces -Y.
struct Piece {
    parts: Vec<Part>,
    /// Half its extent over the floor.
    half: Vec2,
    /// Pelvis place of whoever sits on it.
    seat: Option<Vec3>,
}

/// A rectangle on the floor, turned.
struct Footprint {
    at: Vec2,
    yaw: f32,
    half: Vec2,
}

/// Room number `seed`.
pub fn practice_room(seed: u64) -> PracticeRoom {
    let mut rng = Pcg64::seed_from_u64(seed);
    let size = Vec2::new(rng.random_range(3.2..7.5), rng.random_range(3.0..6.5));
    let mut maker = Maker { room: PracticeRoom::default(), size, taken: Vec::new() };
    maker.walls(&mut rng);
    maker.desk(&mut rng);
    let pieces = (size.x * size.y / 2.4) as usize + rng.random_range(0..3usize);
    for i in 0..pieces {
        match rng.random_range(0..10) {
            _ if i == 0 => maker.against_wall(sofa(&mut rng), &mut rng),
            0 | 1 => maker.against_wall(sofa(&mut rng), &mut rng),
            2 | 3 => maker.table_with_chairs(&mut rng),
            4 if rng.random::<f32>() < 0.5 => maker.counter(&mut rng),
            4 => maker.anywhere(stool(&mut rng), &mut rng),
            5 | 6 => maker.against_wall(cabinet(&mut rng), &mut rng),
            7 => maker.anywhere(chair(&mut rng), &mut rng),
            8 => maker.gap(&mut rng),
            _ => maker.anywhere(clutter(&mut rng), &mut rng),
        }
    }
    maker.stops(&mut rng);
    maker.room
}

struct Maker {
    room: PracticeRoom,
    size: Vec2,
    taken: Vec<Footprint>,
}

impl Maker {
    fn add_box(&mut self, low: Vec3, high: Vec3, at: Vec2, yaw: f32) {
        let base = self.room.positions.len() as u32;
        for i in 0..8 {
            let pick = |axis: usize| if i & (1 << axis) == 0 { low[axis] } else { high[axis] };
            let place = at + rotate(yaw, Vec2::new(pick(0), pick(1)));
            self.room.positions.push(place.extend(pick(2)));
        }
        for q in [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]] {
            self.room.triangles.push([base + q[0], base + q[1], base + q[2]]);
            self.room.triangles.push([base + q[0], base + q[2], base + q[3]]);
        }
    }

    fn walls(&mut self, rng: &mut impl Rng) {
        let half = self.size / 2.0;
        let (h, t) = (half.extend(0.0), 0.1);
        self.add_box(Vec3::new(-h.x, -h.y, -0.1), Vec3::new(h.x, h.y, 0.0), Vec2::ZERO, 0.0);
        for (low, high) in [
            (Vec3::new(-h.x - t, -h.y - t, 0.0), Vec3::new(-h.x, h.y + t, 2.4)),
            (Vec3::new(h.x, -h.y - t, 0.0), Vec3::new(h.x + t, h.y + t, 2.4)),
            (Vec3::new(-h.x, -h.y - t, 0.0), Vec3::new(h.x, -h.y, 2.4)),
            (Vec3::new(-h.x, h.y, 0.0), Vec3::new(h.x, h.y + t, 2.4)),
        ] {
            self.add_box(low, high, Vec2::ZERO, 0.0);
        }
        if self.size.x > 5.0 && rng.random::<f32>() < 0.6 {
            // A wall across, with a door.
            let x = rng.random_range(-0.6..0.6);
            let door = rng.random_range(0.72..0.95);
            let y = rng.random_range(-h.y + 0.3..h.y - 0.3 - door);
            for (from, to) in [(-h.y, y), (y + door, h.y)] {
                self.add_box(Vec3::new(x - 0.05, from, 0.0), Vec3::new(x + 0.05, to, 2.4), Vec2::ZERO, 0.0);
                let middle = Vec2::new(x, (from + to) / 2.0);
                self.taken.push(Footprint { at: middle, yaw: 0.0, half: Vec2::new(0.05, (to - from) / 2.0) });
            }
            // Nothing in the door.
            let clear = Vec2::new(0.7, door / 2.0);
            self.taken.push(Footprint { at: Vec2::new(x, y + door / 2.0), yaw: 0.0, half: clear });
        }
    }

    /// Whether a rectangle lies inside the room and clear of the others, by its corners and middle.
    fn is_free(&self, new: &Footprint, room: f32) -> bool {
        let grown = new.half + room;
        let samples = [-1.0, -0.5, 0.0, 0.5, 1.0];
        let inside = |point: Vec2, other: &Footprint, margin: f32| {
            let local = rotate(-other.yaw, point - other.at).abs();
            local.cmplt(other.half + margin).all()
        };
        samples.iter().all(|u| {
            samples.iter().all(|v| {
                let point = new.at + rotate(new.yaw, new.half * Vec2::new(*u, *v));
                point.abs().cmple(self.size / 2.0).all()
                    && self.taken.iter().all(|other| {
                        let theirs = other.at + rotate(other.yaw, other.half * Vec2::new(*u, *v));
                        let grown = Footprint { half: grown, ..*new };
                        !inside(point, other, room) && !inside(theirs, &grown, 0.0)
                    })
            })
        })
    }

    /// Puts a piece there if it is free; whether it was.
    fn put(&mut self, piece: &Piece, at: Vec2, yaw: f32, room: f32) -> bool {
        let footprint = Footprint { at, yaw, half: piece.half };
        if !self.is_free(&footprint, room) {
            return false;
        }
        self.force(piece, footprint);
        true
    }

    fn force(&mut self, piece: &Piece, footprint: Footprint) {
        let (at, yaw) = (footprint.at, footprint.yaw);
        for (low, high) in &piece.parts {
            self.add_box(*low, *high, at, yaw);
        }
        if let Some(seat) = piece.seat {
            let place = at + rotate(yaw, seat.truncate());
            self.room.cues.push(ActionCue {
                name: format!("Seat {}", self.room.cues.len() + 1),
                action_type: ActionType::Sit,
                position: place.extend(seat.z),
                yaw,
                feet: [None, None],
            });
        }
        self.taken.push(footprint);
    }

    fn random_place(&self, margin: f32, rng: &mut impl Rng) -> Vec2 {
        let half = (self.size / 2.0 - margin).max(Vec2::splat(0.1));
        Vec2::new(rng.random_range(-half.x..half.x), rng.random_range(-half.y..half.y))
    }

    fn anywhere(&mut self, piece: Piece, rng: &mut impl Rng) {
        for _ in 0..TRIES {
            let room = rng.random_range(0.35..0.8);
            let (at, yaw) = (self.random_place(0.6, rng), rng.random_range(-PI..PI));
            if self.put(&piece, at, yaw, room) {
                return;
            }
        }
    }

    /// With its back to a wall.
    fn against_wall(&mut self, piece: Piece, rng: &mut impl Rng) {
        for _ in 0..TRIES {
            // Facing -Y means the back at +Y.
            let (yaw, along, depth) = match rng.random_range(0..4) {
                0 => (0.0, self.size.x, self.size.y),
                1 => (FRAC_PI_2, self.size.y, self.size.x),
                2 => (PI, self.size.x, self.size.y),
                _ => (-FRAC_PI_2, self.size.y, self.size.x),
            };
            let slack = along / 2.0 - piece.half.x;
            if slack <= 0.05 {
                continue;
            }
            let local = Vec2::new(rng.random_range(-slack..slack), depth / 2.0 - piece.half.y - 0.01);
            if self.put(&piece, rotate(yaw, local), yaw, 0.0) {
                return;
            }
        }
    }

    /// A table with one to four chairs, pulled out by more or less.
    fn table_with_chairs(&mut self, rng: &mut impl Rng) {
        let table = table(rng);
        for _ in 0..TRIES {
            let (at, yaw) = (self.random_place(1.2, rng), rng.random_range(-PI..PI));
            let around = Piece { parts: Vec::new(), half: table.half + 0.5, seat: None };
            if !self.is_free(&Footprint { at, yaw, half: around.half }, 0.25) {
                continue;
            }
            let half = table.half;
            self.force(&table, Footprint { at, yaw, half });
            let sides = [(0.0, half.y), (PI, half.y), (FRAC_PI_2, half.x), (-FRAC_PI_2, half.x)];
            for (turn, reach) in sides {
                if rng.random::<f32>() < 0.55 {
                    let chair = chair(rng);
                    let out = rng.random_range(0.08..0.5);
                    // Facing the table from its side.
                    let facing = yaw + turn;
                    let place = at + rotate(facing, Vec2::new(0.0, reach + out));
                    self.put(&chair, place, facing, -0.3);
                }
            }
            return;
        }
    }

    /// A desk against a wall with its chair, which leaves so little room that one sits down from the side.
    fn desk(&mut self, rng: &mut impl Rng) {
        let (desk, chair) = (table(rng), chair(rng));
        let out = rng.random_range(0.05..0.35);
        for _ in 0..TRIES {
            let yaw = FRAC_PI_2 * rng.random_range(0..4) as f32;
            let along = if yaw.sin().abs() > 0.5 { self.size.yx() } else { self.size };
            let slack = along.x / 2.0 - desk.half.x;
            // The chair faces the wall.
            let local = Vec2::new(rng.random_range(-slack..slack), along.y / 2.0 - desk.half.y - 0.01);
            let room = Vec2::new(desk.half.x.max(0.8), desk.half.y + 0.75);
            let around = local - Vec2::new(0.0, 0.7);
            if !self.is_free(&Footprint { at: rotate(yaw, around), yaw, half: room }, 0.0) {
                continue;
            }
            let half = desk.half;
            self.force(&desk, Footprint { at: rotate(yaw, local), yaw, half });
            let sideways = rng.random_range(-0.15..0.15);
            let place = local - Vec2::new(sideways, half.y + out);
            self.force(&chair, Footprint { at: rotate(yaw, place), yaw: yaw + PI, half: chair.half });
            let clear = Vec2::new(0.8, 0.5);
            self.taken.push(Footprint { at: rotate(yaw, place), yaw, half: clear });
            return;
        }
    }

    /// A counter with high stools before it, some pulled out so little that their riders mount from the side.
    fn counter(&mut self, rng: &mut impl Rng) {
        let half = Vec2::new(rng.random_range(1.0..2.2), rng.random_range(0.35..0.6)) / 2.0;
        let height = rng.random_range(0.88..1.1);
        let top = part((-half.x, half.x), (-half.y, half.y), (height - 0.04, height));
        let body = part((-half.x, half.x), (-0.5 * half.y, half.y), (0.0, height));
        let counter = Piece { parts: vec![top, body], half, seat: None };
        for _ in 0..TRIES {
            let (at, yaw) = (self.random_place(1.0, rng), rng.random_range(-PI..PI));
            let whole = Footprint { at, yaw, half: half + Vec2::new(0.2, 0.9) };
            if !self.is_free(&whole, 0.1) {
                continue;
            }
            self.force(&counter, Footprint { at, yaw, half });
            for x in [-0.5 * half.x, 0.5 * half.x] {
                let mut stool = stool(rng);
                let lift = (height - rng.random_range(0.22..0.32)) - stool.parts[0].1.z;
                stool.parts.iter_mut().for_each(|p| p.1.z += lift);
                stool.parts[0].0.z = stool.parts[0].0.z.min(stool.parts[0].1.z - 0.05);
                stool.seat = stool.seat.map(|s| s + Vec3::Z * lift);
                let out = stool.half.y + rng.random_range(-0.05..0.35);
                let place = at + rotate(yaw, Vec2::new(x, -half.y - out));
                self.put(&stool, place, yaw + PI, -0.25);
            }
            self.taken.push(whole);
            return;
        }
    }

    /// Two tall pieces with a gap between them that one just fits through.
    fn gap(&mut self, rng: &mut impl Rng) {
        let gap = rng.random_range(0.55..0.8);
        let (depth, height) = (rng.random_range(0.3..1.0), rng.random_range(0.9..1.8));
        for _ in 0..TRIES {
            let (at, yaw) = (self.random_place(1.0, rng), rng.random_range(-PI..PI));
            let width = rng.random_range(0.3..0.9);
            let side = |sign: f32| Footprint {
                at: at + rotate(yaw, Vec2::new(sign * (gap + width) / 2.0, 0.0)),
                yaw,
                half: Vec2::new(width, depth) / 2.0,
            };
            let whole = Footprint { at, yaw, half: Vec2::new(gap / 2.0 + width, depth / 2.0 + 0.5) };
            if !self.is_free(&whole, 0.1) {
                continue;
            }
            let part = block(Vec2::new(width, depth), height);
            self.force(&part, side(1.0));
            self.force(&part, side(-1.0));
            self.taken.push(whole);
            return;
        }
    }

    /// A few places to stop at.
    fn stops(&mut self, rng: &mut impl Rng) {
        let mut made = 0;
        for _ in 0..TRIES {
            let (at, yaw) = (self.random_place(0.4, rng), rng.random_range(-PI..PI));
            if self.is_free(&Footprint { at, yaw, half: Vec2::splat(0.3) }, 0.05) {
                self.room.cues.push(ActionCue {
                    name: format!("Stop {}", self.room.cues.len() + 1),
                    action_type: ActionType::Stop,
                    position: at.extend(REST_HIPS_HEIGHT),
                    yaw,
                    feet: [None, None],
                });
                made += 1;
                if made == 2 {
                    return;
                }
            }
        }
    }
}

fn part(x: (f32, f32), y: (f32, f32), z: (f32, f32)) -> Part {
    (Vec3::new(x.0, y.0, z.0), Vec3::new(x.1, y.1, z.1))
}

fn block(size: Vec2, height: f32) -> Piece {
    let half = size / 2.0;
    Piece { parts: vec![part((-half.x, half.x), (-half.y, half.y), (0.0, height))], half, seat: None }
}

fn legs(parts: &mut Vec<Part>, half: Vec2, thick: f32, height: f32) {
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        let (x, y) = (x * (half.x - thick), y * (half.y - thick));
        parts.push(part((x - thick, x + thick), (y - thick, y + thick), (0.0, height)));
    }
}

fn sofa(rng: &mut impl Rng) -> Piece {
    let (width, depth): (f32, f32) = (rng.random_range(0.75..2.2), rng.random_range(0.75..0.95));
    let seat = rng.random_range(0.30..0.48);
    let half = Vec2::new(width, depth) / 2.0;
    let back = 0.22;
    let mut parts = vec![
        part((-half.x, half.x), (-half.y, half.y - back), (0.0, seat)),
        part((-half.x, half.x), (half.y - back, half.y), (0.0, seat + 0.4)),
    ];
    let mut inner = half.x;
    if rng.random::<f32>() < 0.7 {
        inner -= 0.15;
        for x in [(-half.x, -inner), (inner, half.x)] {
            parts.push(part(x, (-half.y, half.y - back), (0.0, seat + 0.2)));
        }
    }
    let slack = (inner - 0.26).max(0.01);
    let pelvis = Vec3::new(
        rng.random_range(-slack..slack),
        half.y - back - rng.random_range(0.16..0.30),
        seat + SEATED_HIPS_HEIGHT,
    );
    Piece { parts, half, seat: Some(pelvis) }
}

fn chair(rng: &mut impl Rng) -> Piece {
    let (width, seat) = (rng.random_range(0.38..0.5), rng.random_range(0.40..0.52));
    let half = Vec2::new(width, rng.random_range(0.40..0.5)) / 2.0;
    let mut parts = vec![part((-half.x, half.x), (-half.y, half.y), (seat - 0.04, seat))];
    legs(&mut parts, half, 0.02, seat - 0.04);
    if rng.random::<f32>() < 0.85 {
        parts.push(part(
            (-half.x, half.x),
            (half.y - 0.03, half.y),
            (seat, seat + rng.random_range(0.3..0.5)),
        ));
    }
    Piece {
        parts,
        half,
        seat: Some(Vec3::new(0.0, half.y - rng.random_range(0.16..0.24), seat + SEATED_HIPS_HEIGHT)),
    }
}

fn stool(rng: &mut impl Rng) -> Piece {
    let seat = rng.random_range(0.40..0.75);
    let half = Vec2::splat(rng.random_range(0.30..0.5)) / 2.0;
    let mut parts = vec![part((-half.x, half.x), (-half.y, half.y), (seat - 0.05, seat))];
    if rng.random::<f32>() < 0.5 {
        legs(&mut parts, half, 0.02, seat - 0.05);
    } else {
        parts[0].0.z = 0.0;
    }
    Piece {
        parts,
        half,
        seat: Some(Vec3::new(0.0, rng.random_range(-0.02..0.06), seat + SEATED_HIPS_HEIGHT)),
    }
}

fn table(rng: &mut impl Rng) -> Piece {
    let half = Vec2::new(rng.random_range(0.7..1.6), rng.random_range(0.6..0.9)) / 2.0;
    let height = rng.random_range(0.70..0.78);
    let mut parts = vec![part((-half.x, half.x), (-half.y, half.y), (height - 0.04, height))];
    if rng.random::<f32>() < 0.8 {
        legs(&mut parts, half, 0.03, height - 0.04);
    } else {
        // As a scan has it: a lump down to the floor.
        parts[0].0.z = 0.0;
    }
    Piece { parts, half, seat: None }
}

fn cabinet(rng: &mut impl Rng) -> Piece {
    block(Vec2::new(rng.random_range(0.4..1.6), rng.random_range(0.3..0.6)), rng.random_range(0.7..2.0))
}

fn clutter(rng: &mut impl Rng) -> Piece {
    block(Vec2::new(rng.random_range(0.2..0.9), rng.random_range(0.2..0.9)), rng.random_range(0.25..1.3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Progress;
    use crate::scene::{ClearPath, SceneIndex, SceneSettings};

    #[test]
    fn rooms_are_sound_and_differ() {
        let (mut sits, mut stops, mut reached) = (0, 0, 0);
        let mut asked = std::collections::HashSet::new();
        for seed in 0..12 {
            let room = practice_room(seed);
            assert_eq!(room.positions, practice_room(seed).positions);
            assert_ne!(room.positions, practice_room(seed + 1).positions);
            let scene = SceneIndex::build(
                &room.positions,
                &room.triangles,
                &SceneSettings::default(),
                &Progress::new(),
            )
            .expect("a room");
            assert!(scene.floor_height().abs() < 0.02);
            for cue in &room.cues {
                asked.insert(cue.action_type);
                let sit = cue.seat_height().is_some();
                (sits, stops) = (sits + usize::from(sit), stops + usize::from(!sit));
                reached += usize::from(!ClearPath::to_cue(&scene, cue).approach_points().is_empty());
                if sit {
                    // The seat lies under the cue.
                    let down = scene.ray(cue.position, Vec3::NEG_Z, 0.5).expect("a seat");
                    assert!((down - SEATED_HIPS_HEIGHT).abs() < 1e-3, "{down}");
                }
            }
        }
        assert!(ActionType::of_cues().all(|action_type| asked.contains(&action_type)), "{asked:?}");
        assert!(sits > 24 && stops > 12 && reached * 10 > (sits + stops) * 7, "{sits} {stops} {reached}");
    }
}
