//! A file of rows, one JSON object per line, indexed by run.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use super::plan::Campaign;
use super::row::Row;
use super::{CampaignError, shard::Shard};

/// Maximum length of a row, in bytes; about a thousand times the usual.
const LINE_MAX: u64 = 1 << 20;

/// Index of the rows of a campaign's shard in a file; 16 bytes of memory per run.
#[derive(Debug)]
pub(super) struct Rows {
    path: PathBuf,
    reader: BufReader<File>,
    position: u64,
    shard: Shard,
    /// Offset of the line of each of the shard's runs, in order.
    offsets: Vec<Option<u64>>,
    found: u64,
    /// End of the last valid line. Bytes after it were being written when the process stopped.
    valid_len: u64,
}

impl Rows {
    /// Scans a file up to its end, or to the first line that is invalid, of another shard or a duplicate.
    pub(super) fn scan(
        path: &Path,
        file: File,
        campaign: &Campaign,
    ) -> Result<Self, CampaignError> {
        let runs = usize::try_from(campaign.shard_runs()).expect("at most RUNS_MAX");
        let mut rows = Self {
            path: path.to_owned(),
            reader: BufReader::new(file),
            position: 0,
            shard: campaign.shard,
            offsets: vec![None; runs],
            found: 0,
            valid_len: 0,
        };
        loop {
            let start = rows.valid_len;
            let line = rows.line(start).map_err(|error| rows.unreadable(error))?;
            let row = line
                .as_deref()
                .and_then(|line| serde_json::from_str::<Row>(line).ok());
            let own =
                row.filter(|row| row.run < campaign.runs() && row.belongs_to(campaign, row.run));
            let place = own.and_then(|row| rows.shard.place(row.run)).map(to_index);
            match (line, place) {
                (Some(line), Some(place)) if rows.offsets[place].is_none() => {
                    rows.offsets[place] = Some(start);
                    rows.found += 1;
                    rows.valid_len = start + line.len() as u64;
                }
                _ => return Ok(rows),
            }
        }
    }

    /// End of the last valid line.
    pub(super) const fn valid_len(&self) -> u64 {
        self.valid_len
    }

    /// Number of runs with a row.
    pub(super) const fn found(&self) -> u64 {
        self.found
    }

    pub(super) fn is_complete(&self) -> bool {
        self.found == self.offsets.len() as u64
    }

    /// Whether a run of this shard has its row.
    pub(super) fn has(&self, run: u64) -> bool {
        self.offset(run).is_some()
    }

    fn offset(&self, run: u64) -> Option<u64> {
        let place = self.shard.place(run)?;
        self.offsets.get(to_index(place)).copied().flatten()
    }

    /// The row of a run, and its line with the line feed; `None` if there is no row.
    pub(super) fn row(&mut self, run: u64) -> Result<Option<(Row, String)>, CampaignError> {
        let Some(offset) = self.offset(run) else {
            return Ok(None);
        };
        let read = self.line(offset).and_then(|line| {
            let line = line.ok_or(io::ErrorKind::UnexpectedEof)?;
            Ok((serde_json::from_str(&line)?, line))
        });
        read.map(Some).map_err(|error| self.unreadable(error))
    }

    /// The line at `offset` with its line feed; `None` if there is no complete line.
    fn line(&mut self, offset: u64) -> io::Result<Option<String>> {
        match i64::try_from(i128::from(offset) - i128::from(self.position)) {
            // Keeps the buffer if possible.
            Ok(distance) => self.reader.seek_relative(distance)?,
            Err(_) => self.reader.seek(SeekFrom::Start(offset)).map(drop)?,
        }
        self.position = offset;
        let mut line = Vec::new();
        let read = (&mut self.reader)
            .take(LINE_MAX)
            .read_until(b'\n', &mut line)?;
        self.position += read as u64;
        let line = String::from_utf8(line).ok();
        Ok(line.filter(|line| line.ends_with('\n')))
    }

    fn unreadable(&self, source: io::Error) -> CampaignError {
        CampaignError::Read {
            path: self.path.clone(),
            source,
        }
    }
}

fn to_index(place: u64) -> usize {
    usize::try_from(place).expect("at most RUNS_MAX")
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::campaign::{plan, row};

    fn scan(text: &[u8], campaign: &Campaign) -> Rows {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rows");
        fs::write(&path, text).unwrap();
        Rows::scan(&path, File::open(&path).unwrap(), campaign).unwrap()
    }

    fn line(campaign: &Campaign, run: u64) -> String {
        serde_json::to_string(&row::tests::row(campaign, run, false)).unwrap() + "\n"
    }

    #[test]
    fn rows_are_found_by_run_in_any_order_of_the_file() {
        let campaign = plan::tests::campaign();
        let lines: Vec<_> = [7, 3, 29, 0].map(|run| line(&campaign, run)).into();
        let mut rows = scan(lines.concat().as_bytes(), &campaign);
        assert_eq!(rows.found(), 4);
        for (run, line) in [7, 3, 29, 0].into_iter().zip(&lines) {
            let (row, read) = rows.row(run).unwrap().unwrap();
            assert_eq!((row.run, &read), (run, line));
        }
        assert!(!rows.has(1) && rows.row(1).unwrap().is_none());
        assert!(!rows.has(1_000));
    }

    #[test]
    fn truncated_file_keeps_its_complete_lines() {
        let campaign = plan::tests::campaign();
        let lines: Vec<_> = (0..3).map(|run| line(&campaign, run)).collect();
        let text = lines.concat();
        for cut in 0..=text.len() {
            let rows = scan(&text.as_bytes()[..cut], &campaign);
            let whole = text[..cut].matches('\n').count() as u64;
            assert_eq!(rows.found(), whole, "{cut}");
            assert_eq!(
                rows.valid_len(),
                lines
                    .iter()
                    .take(whole as usize)
                    .map(|it| it.len() as u64)
                    .sum::<u64>()
            );
        }
    }

    #[test]
    fn scan_stops_at_the_first_invalid_line() {
        let mut campaign = plan::tests::campaign();
        campaign.shard = "1/2".parse().unwrap();
        let good = line(&campaign, 2);
        let mut other = campaign.clone();
        other.seeds = "11..16".parse().unwrap();
        let bad = [
            "\n".to_owned(),
            "{}\n".to_owned(),
            "\u{0}\u{0}\n".to_owned(),
            line(&campaign, 1),
            line(&campaign, 2),
            line(&other, 4),
        ];
        for bad in bad {
            let text = format!("{good}{bad}{}", line(&campaign, 6));
            let rows = scan(text.as_bytes(), &campaign);
            assert_eq!(
                (rows.found(), rows.valid_len()),
                (1, good.len() as u64),
                "{bad}"
            );
        }
    }
}
