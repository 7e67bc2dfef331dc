//! Why a text is refused: what is wrong, where, and what is accepted.

use std::ops::Range;

/// A text that can't be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct Refusal {
    /// Where, in bytes of the text.
    pub span: Range<usize>,
    /// What is wrong.
    pub message: String,
    /// What would be accepted.
    pub accepted: String,
}

impl Refusal {
    /// A refusal at `span` of a text, in bytes.
    #[must_use]
    pub fn new(
        span: Range<usize>,
        message: impl Into<String>,
        accepted: impl Into<String>,
    ) -> Self {
        Self {
            span,
            message: message.into(),
            accepted: accepted.into(),
        }
    }
}
