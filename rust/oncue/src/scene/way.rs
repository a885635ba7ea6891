//! The way to a cue through its waypoints: a clear path to each of them in turn, and to the cue.

use glam::Vec2;

use super::SceneIndex;
use super::clear_path::{ClearPath, points_along};
use crate::cue::{ActionCue, InitialState, PassCue};

/// Clear paths that are gone one after the other. Which of them one is on, from 0, is for whoever goes to know: it is the `leg` that
/// is asked for everywhere.
#[derive(Debug, Clone)]
pub struct Way {
    /// To each waypoint, and to the cue.
    legs: Vec<ClearPath>,
    /// Metres that follow after each of them.
    after: Vec<f32>,
}

impl Way {
    /// The ways to `cue` through `passes`, in their order.
    pub fn to_cue(scene: &SceneIndex, passes: &[PassCue], cue: &ActionCue) -> Self {
        let mut legs: Vec<ClearPath> =
            passes.iter().map(|pass| ClearPath::to_cue(scene, &pass.as_stop())).collect();
        legs.push(ClearPath::to_cue(scene, cue));
        let mut after = vec![0.0; legs.len()];
        for leg in (1..legs.len()).rev() {
            after[leg - 1] = after[leg] + legs[leg].distance(legs[leg - 1].goal());
        }
        Self { legs, after }
    }

    /// Where the way from `start` begins; see [`ClearPath::departure`].
    pub fn departure(&self, scene: &SceneIndex, start: &InitialState) -> Vec2 {
        self.legs[0].departure(scene, start)
    }

    /// The waypoint that a leg leads to; `None` for the last leg, which leads to the cue.
    pub fn waypoint(&self, leg: usize) -> Option<Vec2> {
        (leg + 1 < self.legs.len()).then(|| self.legs[leg].goal())
    }

    /// The waypoints from that of a leg on.
    pub fn waypoints(&self, leg: usize) -> impl Iterator<Item = Vec2> {
        (leg..self.legs.len()).filter_map(|leg| self.waypoint(leg))
    }

    /// One leg's clear path.
    pub fn leg(&self, leg: usize) -> &ClearPath {
        &self.legs[leg]
    }

    /// The clear path to the cue.
    pub fn last(&self) -> &ClearPath {
        &self.legs[self.legs.len() - 1]
    }

    /// Metres of the clear floor from `xy`, on a leg, to the cue; infinite where no way leads.
    pub fn distance(&self, leg: usize, xy: Vec2) -> f32 {
        self.legs[leg].distance(xy) + self.after[leg]
    }

    /// The same by the straight line to where the leg ends.
    pub fn straight_distance(&self, leg: usize, xy: Vec2) -> f32 {
        xy.distance(self.legs[leg].goal()) + self.after[leg]
    }

    /// The points so many metres ahead of `xy`, on a leg: round the waypoints, to the way's end where it is shorter.
    pub fn points_ahead<const N: usize>(&self, leg: usize, xy: Vec2, distances: [f32; N]) -> [Vec2; N] {
        points_along(xy, distances, |visit| self.follow(leg, xy, visit))
    }

    /// The whole way from `from`: points about half a cell apart, `from` first. It ends where a leg leads nowhere.
    pub fn path(&self, from: Vec2) -> Vec<Vec2> {
        let mut points = vec![from];
        self.follow(0, from, &mut |point| {
            points.push(point);
            true
        });
        points
    }

    fn follow(&self, leg: usize, from: Vec2, visit: &mut dyn FnMut(Vec2) -> bool) {
        let (mut here, mut goes_on) = (from, true);
        for leg in leg..self.legs.len() {
            // A leg that leads nowhere gives no points, and what follows it is not walked either.
            if !self.legs[leg].distance(here).is_finite() {
                return;
            }
            self.legs[leg].follow(here, |point| {
                goes_on = visit(point);
                goes_on
            });
            if !goes_on {
                return;
            }
            here = self.legs[leg].goal();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_world::{close, room, stop_cue};

    fn pass(x: f32, y: f32) -> PassCue {
        PassCue { name: "By".into(), position: glam::Vec3::new(x, y, 0.0) }
    }

    #[test]
    fn a_way_is_as_long_as_its_legs_and_leads_round_its_waypoints() {
        let scene = room(&[]);
        let way =
            Way::to_cue(&scene, &[pass(0.0, -2.0), pass(2.0, -2.0)], &stop_cue(Vec2::new(2.0, 1.0), 0.0));
        close(way.distance(0, Vec2::ZERO), 7.0, 0.15);
        close(way.distance(1, Vec2::new(0.0, -2.0)), 5.0, 0.1);
        close(way.distance(2, Vec2::new(2.0, -2.0)), 3.0, 0.1);
        assert_eq!(way.waypoints(0).count(), 2);
        assert_eq!((way.waypoint(1), way.waypoint(2)), (Some(Vec2::new(2.0, -2.0)), None));
        let ahead = way.points_ahead(0, Vec2::new(0.0, -1.0), [0.5, 2.0, 3.5, 99.0]);
        for (found, expected) in ahead.into_iter().zip([[0.0, -1.5], [1.0, -2.0], [2.0, -1.5], [2.0, 1.0]]) {
            assert!(found.distance(Vec2::from(expected)) < 0.1, "{found} is not {expected:?}");
        }
        let path = way.path(Vec2::ZERO);
        for place in way.waypoints(0).chain([Vec2::ZERO, Vec2::new(2.0, 1.0)]) {
            assert!(path.iter().any(|point| point.distance(place) < 0.06), "{place}");
        }
    }

    #[test]
    fn a_way_without_waypoints_is_its_clear_path() {
        let scene = room(&[([-0.5, -0.9, 0.0], [0.5, -0.6, 1.0])]);
        let cue = stop_cue(Vec2::new(0.1, -2.0), 0.0);
        let (way, path) = (Way::to_cue(&scene, &[], &cue), ClearPath::to_cue(&scene, &cue));
        for x in [-1.0, 0.0, 0.3, 2.0] {
            let from = Vec2::new(x, 0.4);
            assert_eq!(way.distance(0, from), path.distance(from));
            assert_eq!(way.points_ahead(0, from, [0.4, 1.0, 9.0]), path.points_ahead(from, [0.4, 1.0, 9.0]));
        }
    }

    #[test]
    fn a_leg_that_leads_nowhere_makes_the_way_endless() {
        // A wall across the room.
        let scene = room(&[([-3.0, -1.6, 0.0], [3.0, -1.4, 2.0])]);
        let way = Way::to_cue(&scene, &[pass(1.0, 0.0)], &stop_cue(Vec2::new(0.0, -2.2), 0.0));
        assert!(way.distance(0, Vec2::new(-1.0, 0.0)).is_infinite());
        let path = way.path(Vec2::new(-1.0, 0.0));
        assert!(
            path.last().is_some_and(|end| end.distance(Vec2::new(1.0, 0.0)) < 0.06),
            "it ends where it fails"
        );
    }
}
