use crate::geometry::Ned;

/// A formation before it is turned into its heading: north is ahead, east is to the right.
pub(super) struct Shape {
    /// Each drone's displacement from the centre.
    pub(super) slots: Vec<Ned>,
    /// Which slot is the centre, at the origin.
    pub(super) centre: u32,
    /// How far out each slot counts in the order of succession: whole numbers, so that rounding never decides.
    pub(super) reach: Vec<u64>,
}

impl Shape {
    /// A shape from each slot's displacement, in metres ahead and to the right, and its reach.
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
