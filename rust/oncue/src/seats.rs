//! When which seat carries a person.

/// A seat for as long as it carries the person.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seat {
    /// World height of its surface, metres.
    pub height: f32,
    /// The first frame in which it carries the person: where they begin to sit down.
    pub first: usize,
    /// The last one: where they stand again; [`usize::MAX`] for who stays.
    pub last: usize,
}

/// The seats of a motion: what carries pelvis and thighs is nothing that they run into.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Seats(pub Vec<Seat>);

impl Seats {
    /// One that is sat down on from a frame on, and not left.
    pub fn taken(first: usize, height: f32) -> Self {
        Self(vec![Seat { height, first, last: usize::MAX }])
    }

    /// World height of the seat that carries the person in a frame, metres; of two the one that was taken later.
    pub fn at(&self, frame: usize) -> Option<f32> {
        let carries = |seat: &&Seat| (seat.first..=seat.last).contains(&frame);
        self.0.iter().rev().find(carries).map(|seat| seat.height)
    }

    /// World height of the seat that carries the person in the end, metres.
    pub fn at_end(&self) -> Option<f32> {
        self.at(usize::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_seat_carries_until_it_is_left_and_the_other_from_when_it_is_taken() {
        let left = Seat { height: 0.4, first: 0, last: 10 };
        let taken = Seat { height: 0.5, first: 90, last: usize::MAX };
        let seats = Seats(vec![left, taken]);
        let heights = [0, 10, 11, 89, 90, 200].map(|frame| seats.at(frame));
        assert_eq!(heights, [Some(0.4), Some(0.4), None, None, Some(0.5), Some(0.5)]);
        assert_eq!((seats.at_end(), Seats(vec![left]).at_end()), (Some(0.5), None));
        // Who gets up while sitting down elsewhere is carried by the later one.
        let over = Seats(vec![Seat { last: 95, ..left }, taken]);
        assert_eq!(over.at(92), Some(0.5));
        assert_eq!(Seats::taken(0, 0.5).at(0), Some(0.5));
        assert_eq!(Seats::default().at(0), None);
    }
}
