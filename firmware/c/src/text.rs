//! Words into a buffer of the caller.

use core::fmt;
use core::mem::MaybeUninit;

/// Writes as much of a text as there is room for, always with a 0 at the end, and counts all of it.
struct Writer<'a> {
    room: &'a mut [MaybeUninit<u8>],
    /// Bytes written.
    written: usize,
    /// Bytes of the whole text.
    wanted: usize,
}

impl Writer<'_> {
    /// The 0 at the end does not count.
    fn left(&self) -> usize {
        self.room.len().saturating_sub(self.written).saturating_sub(1)
    }
}

impl fmt::Write for Writer<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        // What follows a cut is left out, too.
        let whole = self.written == self.wanted;
        self.wanted = self.wanted.saturating_add(text.len());
        let fits = if whole { text.floor_char_boundary(self.left()) } else { 0 };
        for (place, byte) in self.room.iter_mut().skip(self.written).zip(text.bytes().take(fits)) {
            place.write(byte);
            self.written += 1;
        }
        Ok(())
    }
}

/// Writes a text for C, cut to the room between two characters; returns the bytes that the whole text has without the 0 at
/// its end.
pub(crate) fn write(room: &mut [MaybeUninit<u8>], text: fmt::Arguments<'_>) -> usize {
    let mut writer = Writer { room, written: 0, wanted: 0 };
    // It never fails, and a text that fails to say itself is short.
    let _ = fmt::write(&mut writer, text);
    let (end, wanted) = (writer.written, writer.wanted);
    if let Some(place) = writer.room.get_mut(end) {
        place.write(0);
    }
    wanted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[allow(unsafe_code)]
    fn written<const N: usize>(text: &str) -> (usize, [u8; N]) {
        let mut room = [MaybeUninit::new(b'#'); N];
        // In two pieces, as formatting does.
        let (first, rest) = text.split_at(1);
        let wanted = write(&mut room, format_args!("{first}{rest}"));
        // SAFETY: initialised above, and nothing takes that back.
        (wanted, room.map(|byte| unsafe { byte.assume_init() }))
    }

    #[test]
    fn texts_end_with_zero_and_are_cut_between_characters() {
        assert_eq!(written::<6>("abcd"), (4, *b"abcd\0#"));
        assert_eq!(written::<5>("abcd"), (4, *b"abcd\0"));
        assert_eq!(written::<4>("abcd"), (4, *b"abc\0"));
        assert_eq!(written::<1>("abcd"), (4, *b"\0"));
        assert_eq!(written::<0>("abcd"), (4, []));
        // Two bytes per letter from the second on.
        assert_eq!(written::<3>("aéé"), (5, *b"a\0#"));
        assert_eq!(written::<4>("aéé"), (5, *b"a\xc3\xa9\0"));
    }
}
