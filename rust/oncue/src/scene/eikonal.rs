//! Travel times over a grid by fast marching (Sethian 1996): the smooth kind of shortest path.
//!
//! Solves |∇T| = cost with T given at the sources. Beside T, the length L of the quickest way is carried along
//! it: ∇T · ∇L = cost.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::raster::Raster;

/// T and L at every cell; infinite where not reached.
#[derive(Debug, Clone)]
pub(super) struct TravelTimes {
    /// Cost times metres.
    pub time: Vec<f32>,
    /// Metres.
    pub length: Vec<f32>,
}

/// A cell in the heap: by time, then by index, so that equal times have one order. Times are never negative,
/// so their bits order as they do.
type Entry = Reverse<(u32, usize)>;

fn entry(time: f32, cell: usize) -> Entry {
    Reverse((time.to_bits(), cell))
}

impl TravelTimes {
    pub(super) fn unreached(raster: &Raster) -> Self {
        Self { time: vec![f32::INFINITY; raster.len()], length: vec![f32::INFINITY; raster.len()] }
    }

    /// Takes the lower of the present time and `time` at a cell.
    pub(super) fn offer(&mut self, cell: usize, time: f32, length: f32) {
        if time < self.time[cell] {
            self.time[cell] = time;
            self.length[cell] = length;
        }
    }

    /// Marches from every reached cell into those where `cost` is finite; the others keep what they have.
    ///
    /// With `settled`, what is reached already is not lowered any more. With `most`, cells are reached only while their length is at most that much longer than where the march began.
    pub(super) fn march(&mut self, raster: &Raster, cost: impl Fn(usize) -> f32, settled: bool, most: f32) {
        let reached = |i: &usize| self.time[*i].is_finite();
        // Where everything reached is settled, only cells with a neighbour to go to begin the march.
        let at_front = |i: &usize| {
            let mut around = raster.neighbours(*i).into_iter().flatten();
            !settled || around.any(|n| !self.time[n].is_finite() && cost(n).is_finite())
        };
        let mut heap: BinaryHeap<Entry> =
            (0..raster.len()).filter(reached).filter(at_front).map(|i| entry(self.time[i], i)).collect();
        // How far a cell lies from where the march began.
        let mut gone = vec![0.0f32; raster.len()];
        let mut done: Vec<bool> = self.time.iter().map(|t| settled && t.is_finite()).collect();
        while let Some(Reverse((bits, cell))) = heap.pop() {
            if f32::from_bits(bits) > self.time[cell] {
                continue;
            }
            done[cell] = true;
            for next in raster.neighbours(cell).into_iter().flatten() {
                let cost = cost(next);
                if done[next] || !cost.is_finite() {
                    continue;
                }
                let (time, length) = self.arrive(raster, next, cost, &done);
                let far = gone[cell] + (length - self.length[cell]).max(0.0);
                if time < self.time[next] && far <= most {
                    self.time[next] = time;
                    self.length[next] = length;
                    gone[next] = far;
                    heap.push(entry(time, next));
                }
            }
        }
    }

    /// T and L at a cell from its settled neighbours, the nearer one of each axis.
    fn arrive(&self, raster: &Raster, cell: usize, cost: f32, done: &[bool]) -> (f32, f32) {
        let step = cost * raster.cell;
        let [left, right, below, above] = raster.neighbours(cell);
        let nearer = |a: Option<usize>, b: Option<usize>| {
            [a, b]
                .into_iter()
                .flatten()
                .filter(|&i| done[i])
                .min_by(|&a, &b| self.time[a].total_cmp(&self.time[b]))
        };
        let from = |i: usize| (self.time[i], self.length[i]);
        let one = |(t, l): (f32, f32)| (t + step, l + raster.cell);
        match (nearer(left, right).map(from), nearer(below, above).map(from)) {
            (Some(a), Some(b)) => {
                let apart = (a.0 - b.0).abs();
                if apart >= step {
                    return one(if a.0 < b.0 { a } else { b });
                }
                let time = 0.5 * (a.0 + b.0 + (2.0 * step * step - apart * apart).sqrt());
                let (wa, wb) = (time - a.0, time - b.0);
                (time, (wa * a.1 + wb * b.1 + step * raster.cell) / (wa + wb))
            }
            (Some(a), None) | (None, Some(a)) => one(a),
            (None, None) => (f32::INFINITY, f32::INFINITY),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    #[test]
    fn open_floor_gives_the_straight_distance() {
        let raster = Raster { origin: Vec2::ZERO, cell: 0.05, width: 101, height: 81 };
        let mut times = TravelTimes::unreached(&raster);
        let goal = raster.center(40 + 101 * 40);
        for i in 0..raster.len() {
            let d = raster.center(i).distance(goal);
            if d < 0.15 {
                times.offer(i, 2.0 * d, d);
            }
        }
        times.march(&raster, |_| 2.0, false, f32::INFINITY);
        for i in 0..raster.len() {
            let d = raster.center(i).distance(goal);
            assert!((times.length[i] - d).abs() < 0.03 + 0.02 * d, "{} for {d}", times.length[i]);
            assert!((times.time[i] - 2.0 * d).abs() < 2.0 * (0.03 + 0.02 * d));
        }
    }

    #[test]
    fn a_wall_is_walked_round() {
        // A wall from below up to y = 3 at x = 2; from (1, 0.5) to (3, 0.5) the way leads over its tip.
        let raster = Raster { origin: Vec2::ZERO, cell: 0.05, width: 80, height: 80 };
        let mut times = TravelTimes::unreached(&raster);
        let goal = raster.index_at(Vec2::new(3.0, 0.5)).unwrap();
        times.offer(goal, 0.0, 0.0);
        let wall = |i: usize| (raster.center(i).x - 2.0).abs() < 0.03 && raster.center(i).y < 3.0;
        times.march(&raster, |i| if wall(i) { f32::INFINITY } else { 1.0 }, false, f32::INFINITY);
        let start = raster.index_at(Vec2::new(1.0, 0.5)).unwrap();
        let expected = 2.0 * (1f32 + 2.5 * 2.5).sqrt();
        assert!((times.length[start] - expected).abs() < 0.05 * expected, "{}", times.length[start]);
        assert!(times.time[raster.index_at(Vec2::new(2.0, 1.0)).unwrap()].is_infinite());
    }
}
