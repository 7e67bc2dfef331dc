//! Fields of messages: one list of fields is both the encoder and the decoder of a message.

use std::fmt;

use crate::message::Encode;

/// A message's body as bytes; only the frame encoder gives them out.
#[derive(Debug, Default)]
pub struct Payload {
    bytes: Vec<u8>,
    /// Whether a field was absent: a message is cut off there, so what follows isn't written.
    ended: bool,
}

impl Payload {
    pub(crate) fn of(message: &impl Encode) -> Self {
        let mut payload = Self::default();
        message.encode(&mut payload);
        payload
    }

    pub(crate) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    pub(crate) fn write(&mut self, bytes: &[u8]) {
        if !self.ended {
            self.bytes.extend(bytes);
        }
    }
}

/// What is left of a payload.
pub(crate) struct Reader<'a> {
    payload: &'a [u8],
    at: usize,
}

/// The payload ends before a field does.
pub(crate) struct Short {
    /// Bytes that the payload needs up to the end of that field.
    pub(crate) needed: usize,
}

impl<'a> Reader<'a> {
    pub(crate) fn new(payload: &'a [u8]) -> Self {
        Self { payload, at: 0 }
    }

    fn left(&self) -> usize {
        self.payload.len() - self.at
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], Short> {
        let needed = self.at + length;
        let bytes = self.payload.get(self.at..needed);
        let bytes = bytes.ok_or(Short { needed })?;
        self.at = needed;
        Ok(bytes)
    }
}

/// A field, or a group of fields.
pub(crate) trait Field: Sized {
    /// The fewest bytes that it takes.
    const SHORTEST: usize;

    fn read(from: &mut Reader<'_>) -> Result<Self, Short>;
    fn write(&self, to: &mut Payload);
}

macro_rules! little_endian {
    ($($number:ty),*) => {$(
        impl Field for $number {
            const SHORTEST: usize = size_of::<$number>();

            fn read(from: &mut Reader<'_>) -> Result<Self, Short> {
                let bytes = from.take(Self::SHORTEST)?;
                Ok(Self::from_le_bytes(bytes.try_into().expect("as many bytes as were asked for")))
            }

            fn write(&self, to: &mut Payload) {
                to.write(&self.to_le_bytes());
            }
        }
    )*};
}

little_endian!(u8, u16, u32, i16, i32);

impl<T: Field + Copy + Default, const N: usize> Field for [T; N] {
    const SHORTEST: usize = N * T::SHORTEST;

    fn read(from: &mut Reader<'_>) -> Result<Self, Short> {
        let mut all = [T::default(); N];
        for one in &mut all {
            *one = T::read(from)?;
        }
        Ok(all)
    }

    fn write(&self, to: &mut Payload) {
        self.iter().for_each(|it| it.write(to));
    }
}

/// A field that older firmware doesn't send.
impl<T: Field> Field for Option<T> {
    const SHORTEST: usize = 0;

    fn read(from: &mut Reader<'_>) -> Result<Self, Short> {
        if from.left() == 0 || from.left() < T::SHORTEST {
            from.at = from.payload.len();
            return Ok(None);
        }
        T::read(from).map(Some)
    }

    fn write(&self, to: &mut Payload) {
        match self {
            Some(it) => it.write(to),
            None => to.ended = true,
        }
    }
}

/// As many as the payload holds; a rest that is shorter than one is ignored.
impl<T: Field> Field for Vec<T> {
    const SHORTEST: usize = 0;

    fn read(from: &mut Reader<'_>) -> Result<Self, Short> {
        let mut all = Self::new();
        while from.left() > 0 && from.left() >= T::SHORTEST {
            all.push(T::read(from)?);
        }
        Ok(all)
    }

    fn write(&self, to: &mut Payload) {
        self.iter().for_each(|it| it.write(to));
    }
}

/// Bytes that have no meaning any more; written as zeros.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Unused<const N: usize>;

impl<const N: usize> Field for Unused<N> {
    const SHORTEST: usize = N;

    fn read(from: &mut Reader<'_>) -> Result<Self, Short> {
        from.take(N)?;
        Ok(Self)
    }

    fn write(&self, to: &mut Payload) {
        to.write(&[0; N]);
    }
}

/// A text of fixed length, such as `BTFL`.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Letters<const N: usize>(pub [u8; N]);

impl<const N: usize> Default for Letters<N> {
    fn default() -> Self {
        Self([b' '; N])
    }
}

impl<const N: usize> fmt::Display for Letters<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(printable(&self.0).trim_end())
    }
}

impl<const N: usize> fmt::Debug for Letters<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", printable(&self.0))
    }
}

impl<const N: usize> Field for Letters<N> {
    const SHORTEST: usize = N;

    fn read(from: &mut Reader<'_>) -> Result<Self, Short> {
        <[u8; N]>::read(from).map(Self)
    }

    fn write(&self, to: &mut Payload) {
        self.0.write(to);
    }
}

/// A text up to the end of the message. What is not printable ASCII was read as `?`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Text(pub String);

impl Field for Text {
    const SHORTEST: usize = 0;

    fn read(from: &mut Reader<'_>) -> Result<Self, Short> {
        Ok(Self(printable(from.take(from.left())?)))
    }

    fn write(&self, to: &mut Payload) {
        to.write(self.0.as_bytes());
    }
}

/// A text with its length in a byte before it; only its first 255 bytes are written. What is not printable ASCII was read
/// as `?`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ShortText(pub String);

impl Field for ShortText {
    const SHORTEST: usize = 1;

    fn read(from: &mut Reader<'_>) -> Result<Self, Short> {
        let length = u8::read(from)?;
        Ok(Self(printable(from.take(length.into())?)))
    }

    fn write(&self, to: &mut Payload) {
        let bytes = self.0.as_bytes();
        let length = u8::try_from(bytes.len()).unwrap_or(u8::MAX);
        length.write(to);
        to.write(&bytes[..length.into()]);
    }
}

/// A controller's text goes to terminals and logs: no control characters.
fn printable(bytes: &[u8]) -> String {
    let printable = |byte: &u8| match byte {
        b' '..=b'~' => char::from(*byte),
        _ => '?',
    };
    bytes.iter().map(printable).collect()
}

/// A list of things with their number, below 16, in a byte before it; Betaflight may use the upper four bits one day.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Counted(pub Vec<u8>);

impl Field for Counted {
    const SHORTEST: usize = 1;

    fn read(from: &mut Reader<'_>) -> Result<Self, Short> {
        let count = u8::read(from)? & 0x0f;
        Ok(Self(from.take(count.into())?.to_vec()))
    }

    fn write(&self, to: &mut Payload) {
        let bytes = &self.0[..self.0.len().min(15)];
        u8::try_from(bytes.len()).expect("15 at most").write(to);
        to.write(bytes);
    }
}

/// A list of things with their number in a byte before it; only the first 255 are written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShortList<T>(pub Vec<T>);

impl<T> Default for ShortList<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: Field> Field for ShortList<T> {
    const SHORTEST: usize = 1;

    fn read(from: &mut Reader<'_>) -> Result<Self, Short> {
        let count = u8::read(from)?;
        (0..count)
            .map(|_| T::read(from))
            .collect::<Result<_, _>>()
            .map(Self)
    }

    fn write(&self, to: &mut Payload) {
        let count = u8::try_from(self.0.len()).unwrap_or(u8::MAX);
        count.write(to);
        self.0.iter().take(count.into()).for_each(|it| it.write(to));
    }
}
