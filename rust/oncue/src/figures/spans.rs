//! Runs of frames in which something goes on, with its worst.

use std::collections::BTreeMap;

/// Frames `first..end` in which `key` went on, and the worst of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Span<K, V> {
    pub key: K,
    pub first: usize,
    pub end: usize,
    pub worst: f32,
    pub worst_frame: usize,
    /// What goes with the worst.
    pub with: V,
}

/// Runs of frames, in the order in which they began.
#[derive(Debug, Clone)]
pub(crate) struct Spans<K, V> {
    runs: Vec<Span<K, V>>,
    last: BTreeMap<K, usize>,
}

impl<K, V> Default for Spans<K, V> {
    fn default() -> Self {
        Self { runs: Vec::new(), last: BTreeMap::new() }
    }
}

impl<K: Copy + Ord, V: Copy> Spans<K, V> {
    /// `key` goes on in `frame`, so much. Frames come in ascending order; a key may come more than once a frame.
    pub(crate) fn add(&mut self, frame: usize, key: K, amount: f32, with: V) {
        let open = self.last.get(&key).and_then(|&run| self.runs.get_mut(run));
        match open.filter(|run| run.end >= frame) {
            Some(run) => {
                run.end = frame + 1;
                if amount > run.worst {
                    (run.worst, run.worst_frame, run.with) = (amount, frame, with);
                }
            }
            None => {
                self.last.insert(key, self.runs.len());
                let span =
                    Span { key, first: frame, end: frame + 1, worst: amount, worst_frame: frame, with };
                self.runs.push(span);
            }
        }
    }

    /// The runs, the worst first.
    pub(crate) fn worst_first(mut self) -> Vec<Span<K, V>> {
        self.runs.sort_by(|a, b| b.worst.total_cmp(&a.worst));
        self.runs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_ends_a_run() {
        let mut spans = Spans::default();
        for (frame, key, amount) in
            [(3, 'a', 1.0), (3, 'b', 9.0), (4, 'a', 3.0), (4, 'a', 2.0), (6, 'a', 5.0)]
        {
            spans.add(frame, key, amount, ());
        }
        let found: Vec<_> =
            spans.worst_first().iter().map(|s| (s.key, s.first..s.end, s.worst, s.worst_frame)).collect();
        assert_eq!(found, [('b', 3..4, 9.0, 3), ('a', 6..7, 5.0, 6), ('a', 3..5, 3.0, 4)]);
    }
}
