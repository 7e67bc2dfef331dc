//! What the fields of a kind of file accept, for error messages.

/// Every field of a kind of file, tables included, in the order of their declaration: its path, a tab, and the values that
/// it takes.
///
/// It is generated from the schema, so that a program that only reads such files does not link what makes a schema.
#[derive(Debug, Clone, Copy)]
pub struct FieldList(&'static str);

impl FieldList {
    /// The list for files that only programs write.
    pub const EMPTY: Self = Self("");

    /// A generated list.
    #[must_use]
    pub const fn new(lines: &'static str) -> Self {
        Self(lines)
    }

    /// Whether there are no fields.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0.is_empty()
    }

    /// The path of each field, and what it accepts.
    pub fn iter(self) -> impl Iterator<Item = (&'static str, &'static str)> {
        self.0.lines().filter_map(|line| line.split_once('\t'))
    }
}
