use crate::geometry::Ned;

/// A formation before it is rotated to its heading: north is ahead, east is to the right.
pub(super) struct Shape {
    /// Displacement of each drone from the centre.
    pub(super) slots: Vec<Ned>,
    /// Index of the centre slot, which is at the origin.
    pub(super) centre: u32,
    /// Distance of each slot from the centre for the order of succession: whole numbers, so rounding never decides.
    pub(super) reach: Vec<u64>,
}

impl Shape {
    /// A shape from the displacement of each slot, in metres ahead and to the right, and its reach.
    pub(super) fn new(centre: u32, slots: impl IntoIterator<Item = ((f64, f64), u64)>) -> Self {
        let (slots, reach) = slots
            .into_iter()
            .map(|((ahead_m, right_m), reach)| (Ned::new(ahead_m, right_m, 0.0), reach))
            .unzip();
        Self {
            slots,
            centre,
            reach,
        }
    }
}
