//! Lines of what a program on a host prints, which may be any bytes.

use tokio::io::{AsyncBufReadExt, AsyncRead, BufReader};

use crate::remote::LINE_MAX;

/// Lines of limited length; what is no UTF-8 is replaced. They end with the input, or at its first error.
pub(super) struct HostLines<R> {
    input: BufReader<R>,
    /// The begin of the next line. A call that is given up loses nothing.
    begun: Vec<u8>,
}

impl<R: AsyncRead + Unpin> HostLines<R> {
    pub(super) fn new(input: R) -> Self {
        Self {
            input: BufReader::new(input),
            begun: Vec::new(),
        }
    }

    /// The next line, without its end. A longer one than [`LINE_MAX`] comes in parts. `None` after the last.
    pub(super) async fn next(&mut self) -> Option<String> {
        let most = usize::try_from(LINE_MAX).unwrap_or(usize::MAX);
        loop {
            let read = self.input.fill_buf().await.unwrap_or_default();
            let is_over = read.is_empty();
            let end = read.iter().position(|it| *it == b'\n');
            let taken = end.map_or(read.len(), |it| it + 1);
            let taken = taken.min(most - self.begun.len());
            self.begun.extend(&read[..taken]);
            self.input.consume(taken);
            let is_whole = self.begun.ends_with(b"\n") || self.begun.len() >= most;
            if is_whole || is_over && !self.begun.is_empty() {
                let line = std::mem::take(&mut self.begun);
                return Some(String::from_utf8_lossy(&line).trim_end().to_owned());
            }
            if is_over {
                return None;
            }
        }
    }

    /// Reads to the end and returns the last line that is not blank.
    pub(super) async fn last(mut self) -> String {
        let mut last = String::new();
        while let Some(line) = self.next().await {
            if !line.trim().is_empty() {
                last = line;
            }
        }
        last
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::AsyncReadExt;

    use super::*;

    fn runtime() -> tokio::runtime::Runtime {
        let runtime = tokio::runtime::Builder::new_current_thread().build();
        runtime.unwrap()
    }

    #[test]
    fn a_greeting_that_is_no_utf_8_ends_no_lines() {
        runtime().block_on(async {
            let printed = b"Gr\xfc\xdfe\r\n{}\n\nlast".as_slice();
            let mut lines = HostLines::new(printed);
            for expected in ["Gr\u{fffd}\u{fffd}e", "{}", "", "last"] {
                assert_eq!(lines.next().await.as_deref(), Some(expected));
            }
            assert_eq!(lines.next().await, None);
            assert_eq!(
                HostLines::new(&b"one\xff\n\n"[..]).last().await,
                "one\u{fffd}"
            );
        });
    }

    #[test]
    fn an_endless_line_comes_in_parts() {
        runtime().block_on(async {
            let endless = tokio::io::repeat(b'x').take(LINE_MAX + 1);
            let mut lines = HostLines::new(endless);
            assert_eq!(lines.next().await.unwrap().len() as u64, LINE_MAX);
            assert_eq!(lines.next().await.as_deref(), Some("x"));
        });
    }
}
