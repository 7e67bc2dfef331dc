//! Images of maps: PGM (both forms) and PNG, as one grey byte and one opacity byte a pixel.

use std::io::Cursor;

use super::CELLS_MAX;

/// Largest image file, in bytes.
pub const IMAGE_SIZE_MAX: usize = 16 << 20;

/// Why an image can't be used: the file is damaged, of another kind, or too large. Nothing is kept of it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ImageError {
    /// Neither PGM nor PNG by its first bytes.
    #[error("this is no PGM and no PNG image: it is {0}")]
    Format(&'static str),
    /// The file is larger than [`IMAGE_SIZE_MAX`].
    #[error("the image has {bytes} bytes, at most {IMAGE_SIZE_MAX} are accepted")]
    Size {
        /// The file's size.
        bytes: usize,
    },
    /// No pixel, or more than [`CELLS_MAX`].
    #[error("the image has {columns} × {rows} pixels; accepted are 1 to {CELLS_MAX}")]
    Pixels {
        /// Pixels in a row.
        columns: usize,
        /// Rows.
        rows: usize,
    },
    /// A number in a PGM's text is missing or out of range.
    #[error("byte {place}: {what} is missing, or no number from {min} to {max}")]
    Number {
        /// Byte of the file.
        place: usize,
        /// What the number is.
        what: &'static str,
        /// Least accepted.
        min: usize,
        /// Most accepted.
        max: usize,
    },
    /// A binary PGM with too few bytes.
    #[error("the pixels end at byte {found}, {expected} are needed")]
    Short {
        /// Bytes of the file.
        found: usize,
        /// Bytes that its header promises.
        expected: usize,
    },
    /// A pixel above the PGM's greatest value.
    #[error("row {row}, column {column}: the pixel is above the image's greatest value, {max}")]
    Bright {
        /// From 1, from the top.
        row: usize,
        /// From 1.
        column: usize,
        /// The greatest value that the header gives.
        max: usize,
    },
    /// The PNG decoder's error.
    #[error("this PNG can't be decoded: {0}")]
    Png(String),
}

/// Pixels, rows from the top.
pub(super) struct Image {
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// The mean of the colours: 0 is black, 255 is white.
    pub(super) grey: Vec<u8>,
    /// 255 is opaque; empty if all is.
    pub(super) alpha: Vec<u8>,
}

pub(super) fn decode(bytes: &[u8]) -> Result<Image, ImageError> {
    if bytes.len() > IMAGE_SIZE_MAX {
        return Err(ImageError::Size { bytes: bytes.len() });
    }
    match bytes {
        [b'P', b'5', ..] => pgm(bytes, Pgm::Binary),
        [b'P', b'2', ..] => pgm(bytes, Pgm::Text),
        [0x89, b'P', b'N', b'G', ..] => png(bytes),
        _ => Err(ImageError::Format(kind(bytes))),
    }
}

/// What a file is that is no image of a map, by its first bytes.
fn kind(bytes: &[u8]) -> &'static str {
    match bytes {
        [] => "empty",
        [b'P', b'1' | b'4', ..] => "a PBM image, black and white",
        [b'P', b'3' | b'6', ..] => "a PPM image, with colours",
        [0xff, 0xd8, 0xff, ..] => "a JPEG image",
        [b'G', b'I', b'F', b'8', ..] => "a GIF image",
        [b'B', b'M', ..] => "a BMP image",
        [b'I', b'I', b'*', 0, ..] | [b'M', b'M', 0, b'*', ..] => "a TIFF image",
        [
            b'R',
            b'I',
            b'F',
            b'F',
            _,
            _,
            _,
            _,
            b'W',
            b'E',
            b'B',
            b'P',
            ..,
        ] => "a WebP image",
        _ if std::str::from_utf8(bytes).is_ok_and(|it| !it.contains('\0')) => "a text",
        _ => "another kind of file",
    }
}

fn pixels(columns: usize, rows: usize) -> Result<usize, ImageError> {
    let pixels = columns.checked_mul(rows);
    let accepted = pixels.filter(|pixels| (1..=CELLS_MAX).contains(pixels));
    accepted.ok_or(ImageError::Pixels { columns, rows })
}

#[derive(Clone, Copy, PartialEq)]
enum Pgm {
    Binary,
    Text,
}

/// Source of the format: *pgm*, Netpbm's manual.
fn pgm(bytes: &[u8], form: Pgm) -> Result<Image, ImageError> {
    let mut place = 2;
    let columns = number(bytes, &mut place, "the width", (1, CELLS_MAX))?;
    let rows = number(bytes, &mut place, "the height", (1, CELLS_MAX))?;
    let max = number(bytes, &mut place, "the greatest value", (1, 65_535))?;
    let count = pixels(columns, rows)?;
    let mut grey = Vec::with_capacity(count);
    let mut push = |value: usize| {
        if value > max {
            let at = grey.len();
            return Err(ImageError::Bright {
                row: at / columns + 1,
                column: at % columns + 1,
                max,
            });
        }
        grey.push(((value * 255 + max / 2) / max) as u8);
        Ok(())
    };
    if form == Pgm::Text {
        for _ in 0..count {
            push(number(bytes, &mut place, "a pixel", (0, 65_535))?)?;
        }
    } else {
        let width = if max > 255 { 2 } else { 1 };
        // One white space ends the header.
        let (start, expected) = (place + 1, place + 1 + count * width);
        let data = bytes.get(start..expected).ok_or(ImageError::Short {
            found: bytes.len(),
            expected,
        })?;
        for value in data.chunks_exact(width) {
            push(
                value
                    .iter()
                    .fold(0, |value, byte| value << 8 | usize::from(*byte)),
            )?;
        }
    }
    Ok(Image {
        columns,
        rows,
        grey,
        alpha: Vec::new(),
    })
}

/// The next number of a PGM's text, after white space and comments.
fn number(
    bytes: &[u8],
    place: &mut usize,
    what: &'static str,
    (min, max): (usize, usize),
) -> Result<usize, ImageError> {
    while let Some(byte) = bytes.get(*place) {
        match byte {
            b'#' => {
                let rest = bytes[*place..].iter();
                *place += rest
                    .take_while(|byte| !matches!(byte, b'\n' | b'\r'))
                    .count();
            }
            byte if byte.is_ascii_whitespace() => *place += 1,
            _ => break,
        }
    }
    let start = *place;
    let mut value = 0_usize;
    while let Some(digit) = bytes.get(*place).filter(|byte| byte.is_ascii_digit()) {
        value = value
            .saturating_mul(10)
            .saturating_add(usize::from(digit - b'0'));
        *place += 1;
    }
    let is_ended = bytes.get(*place).is_none_or(u8::is_ascii_whitespace);
    if *place == start || !is_ended || value < min || value > max {
        return Err(ImageError::Number {
            place: start,
            what,
            min,
            max,
        });
    }
    Ok(value)
}

fn png(bytes: &[u8]) -> Result<Image, ImageError> {
    let broken = |error: png::DecodingError| ImageError::Png(error.to_string());
    let limits = png::Limits {
        bytes: 8 * CELLS_MAX,
    };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().map_err(broken)?;
    let (columns, rows) = (reader.info().width as usize, reader.info().height as usize);
    let count = pixels(columns, rows)?;
    let samples = reader.output_color_type().0.samples();
    let size = reader.output_buffer_size();
    let mut data = vec![0; size.ok_or(ImageError::Pixels { columns, rows })?];
    reader.next_frame(&mut data).map_err(broken)?;
    let has_alpha = samples % 2 == 0;
    let colours = if has_alpha { samples - 1 } else { samples };
    let mut grey = Vec::with_capacity(count);
    let mut alpha = Vec::with_capacity(if has_alpha { count } else { 0 });
    for pixel in data.chunks_exact(samples).take(count) {
        let sum: usize = pixel[..colours].iter().map(|it| usize::from(*it)).sum();
        grey.push(((sum + colours / 2) / colours) as u8);
        alpha.extend(&pixel[colours..]);
    }
    Ok(Image {
        columns,
        rows,
        grey,
        alpha,
    })
}
