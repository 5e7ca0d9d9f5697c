//! Numbers as little-endian bytes and back, bit by bit: NaN payloads and -0.0 survive. The input is an
//! untrusted file, so every length is checked before memory is allocated.

/// The bytes are truncated or have an invalid value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Damaged;

/// Bytes that are read from the front.
#[derive(Clone, Copy, Debug)]
pub(super) struct Take<'a>(pub(super) &'a [u8]);

impl<'a> Take<'a> {
    /// The next bytes, of the given number.
    pub(super) fn bytes(&mut self, len: usize) -> Result<&'a [u8], Damaged> {
        let (head, tail) = self.0.split_at_checked(len).ok_or(Damaged)?;
        self.0 = tail;
        Ok(head)
    }

    /// A count of things that take `each` bytes at least, as far as they can be there.
    pub(super) fn count(&mut self, each: usize) -> Result<usize, Damaged> {
        let count = usize::try_from(u32::take(self)?).map_err(|_| Damaged)?;
        let bytes = count.checked_mul(each).ok_or(Damaged)?;
        if bytes > self.0.len() {
            return Err(Damaged);
        }
        Ok(count)
    }

    /// A run of bytes, preceded by its length.
    pub(super) fn run(&mut self) -> Result<&'a [u8], Damaged> {
        let len = usize::try_from(u64::take(self)?).map_err(|_| Damaged)?;
        self.bytes(len)
    }

    /// As [`Take::run`], as UTF-8 text.
    pub(super) fn text(&mut self) -> Result<String, Damaged> {
        let text = std::str::from_utf8(self.run()?);
        text.map(ToOwned::to_owned).map_err(|_| Damaged)
    }

    /// Checks that everything was read.
    pub(super) fn end(&self) -> Result<(), Damaged> {
        if self.0.is_empty() {
            Ok(())
        } else {
            Err(Damaged)
        }
    }
}

/// Writes the number of items that follow. Every list is shorter than 2^32 (see `limits`).
pub(super) fn put_count(len: usize, to: &mut Vec<u8>) {
    u32::try_from(len).unwrap_or(u32::MAX).put(to);
}

/// Writes a run of bytes, preceded by its length.
pub(super) fn put_run(bytes: &[u8], to: &mut Vec<u8>) {
    (bytes.len() as u64).put(to);
    to.extend_from_slice(bytes);
}

/// The first difference of two values: the path of the field and both values.
pub(super) type Differing = (String, String, String);

/// A value of fixed size.
pub(super) trait Field: Sized {
    /// Its size, bytes.
    const BYTES: usize;

    /// Appends it.
    fn put(&self, to: &mut Vec<u8>);

    /// Reads it from the front.
    fn take(from: &mut Take<'_>) -> Result<Self, Damaged>;

    /// The first difference of two values, compared bit by bit.
    ///
    /// * `skip` - fields of the outermost row that are not compared.
    fn differ(&self, other: &Self, skip: &[&str]) -> Option<Differing>;
}

macro_rules! number {
    ($($type:ty => $bits:expr;)+) => { $(
        impl Field for $type {
            const BYTES: usize = size_of::<$type>();

            fn put(&self, to: &mut Vec<u8>) {
                to.extend_from_slice(&self.to_le_bytes());
            }

            fn take(from: &mut Take<'_>) -> Result<Self, Damaged> {
                let bytes = from.bytes(Self::BYTES)?;
                bytes.try_into().map(Self::from_le_bytes).map_err(|_| Damaged)
            }

            fn differ(&self, other: &Self, _: &[&str]) -> Option<Differing> {
                let bits: fn(&Self) -> u64 = $bits;
                (bits(self) != bits(other)).then(|| {
                    let (mut one, mut two) = (format!("{self:?}"), format!("{other:?}"));
                    if one == two {
                        one += &format!(" ({:#x})", bits(self));
                        two += &format!(" ({:#x})", bits(other));
                    }
                    (String::new(), one, two)
                })
            }
        }
    )+ };
}

number! {
    u8 => |x| u64::from(*x);
    u32 => |x| u64::from(*x);
    u64 => |x| *x;
    f32 => |x| u64::from(x.to_bits());
    f64 => |x| x.to_bits();
}

impl<T: Field + Copy + Default, const N: usize> Field for [T; N] {
    const BYTES: usize = N * T::BYTES;

    fn put(&self, to: &mut Vec<u8>) {
        self.iter().for_each(|one| one.put(to));
    }

    fn take(from: &mut Take<'_>) -> Result<Self, Damaged> {
        let mut all = [T::default(); N];
        for one in &mut all {
            *one = T::take(from)?;
        }
        Ok(all)
    }

    fn differ(&self, other: &Self, _: &[&str]) -> Option<Differing> {
        let mut pairs = self.iter().zip(other).enumerate();
        pairs.find_map(|(at, (one, two))| {
            let (path, one, two) = one.differ(two, &[])?;
            Some((format!("[{at}]{path}"), one, two))
        })
    }
}

/// Writes the number of rows, then the rows.
pub(super) fn put_rows<T: Field>(rows: &[T], to: &mut Vec<u8>) {
    put_count(rows.len(), to);
    to.reserve(rows.len() * T::BYTES);
    rows.iter().for_each(|row| row.put(to));
}

/// Reads such a list into existing memory.
pub(super) fn take_rows<T: Field>(from: &mut Take<'_>, into: &mut Vec<T>) -> Result<(), Damaged> {
    into.clear();
    let count = from.count(T::BYTES)?;
    into.reserve(count);
    for _ in 0..count {
        into.push(T::take(from)?);
    }
    Ok(())
}
