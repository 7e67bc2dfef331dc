//! What is written of a run: a page, tables, recordings and other files.

mod agents;
mod closest;
mod figures;
mod folder;
pub(crate) mod html;
mod mission;
mod recordings;
#[cfg(test)]
pub(crate) mod sample;
mod simplify;
pub(crate) mod table;
mod tracks;
mod write;

pub use folder::{holds, numbered};
pub use html::scaling::{Scaling, scaling};
pub use html::{document, page};
pub use recordings::Recording;
pub use table::table;
pub use tracks::{TRACK_COLUMNS, tracks};
pub use write::{REPORT_HTML, REPORT_JSON, ReportFiles, TRACKS_CSV, WriteError, write, write_file};

pub(crate) use write::{CompleteFile, DraftFile, create_folder, json};
