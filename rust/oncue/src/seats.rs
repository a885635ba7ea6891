//! When which seat carries a person.

/// The seats of a motion: one that the person gets up from first, and one that is sat down on.
///
/// A seat is a frame and the height of its surface, world, metres: what carries pelvis and thighs is nothing that they run into.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Seats {
    /// That which carries the person up to its frame.
    pub left: Option<(usize, f32)>,
    /// That which carries the person from its frame on.
    pub taken: Option<(usize, f32)>,
}

impl Seats {
    /// Only one, from a frame on.
    pub fn taken(from: usize, height: f32) -> Self {
        Self { left: None, taken: Some((from, height)) }
    }

    /// World height of the seat that carries the person in a frame, metres.
    pub fn at(&self, frame: usize) -> Option<f32> {
        let taken = self.taken.filter(|(from, _)| frame >= *from);
        taken.or(self.left.filter(|(until, _)| frame <= *until)).map(|(_, height)| height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_seat_carries_until_it_is_left_and_the_other_from_when_it_is_taken() {
        let seats = Seats { left: Some((10, 0.4)), taken: Some((90, 0.5)) };
        assert_eq!(
            [0, 10, 11, 89, 90, 200].map(|f| seats.at(f)),
            [Some(0.4), Some(0.4), None, None, Some(0.5), Some(0.5)]
        );
        assert_eq!(Seats::taken(0, 0.5).at(0), Some(0.5));
        assert_eq!(Seats::default().at(0), None);
    }
}
