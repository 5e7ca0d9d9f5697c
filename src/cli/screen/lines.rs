//! Lines of the screen. In: parts of a line, colours, the width of the terminal. Out: lines within that width, broken
//! between parts and never within one.

pub(super) const RED: &str = "\x1b[31m";
pub(super) const YELLOW: &str = "\x1b[33m";
pub(super) const GREEN: &str = "\x1b[32m";
pub(super) const BOLD: &str = "\x1b[1m";
const RESET: &str = "\x1b[0m";

/// Width of a line's label, columns; continuation lines are indented by as much.
const LABEL_WIDTH: usize = 11;

/// Whether to use colours.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ink {
    pub(super) colours: bool,
}

impl Ink {
    pub(super) fn paint(self, colour: &str, text: &str) -> String {
        if self.colours && !colour.is_empty() {
            format!("{colour}{text}{RESET}")
        } else {
            text.to_owned()
        }
    }
}

/// Columns that a text takes; colour codes take none.
pub(super) fn columns(text: &str) -> usize {
    let mut chars = text.chars();
    let mut count = 0;
    while let Some(char) = chars.next() {
        match char {
            '\x1b' => drop(chars.by_ref().find(|c| *c == 'm')),
            _ => count += 1,
        }
    }
    count
}

/// Appends the parts with gaps between them. A part that does not fit begins a new line, indented by the label's width.
pub(super) fn flow(text: &mut String, parts: &[String], gap: &str, width: usize) {
    let mut line = String::new();
    for part in parts.iter().filter(|part| !part.is_empty()) {
        if line.is_empty() {
            line.clone_from(part);
        } else if columns(&line) + gap.len() + columns(part.trim_end()) <= width {
            line += gap;
            line += part;
        } else {
            *text += line.trim_end();
            line = format!("\n{:LABEL_WIDTH$}{part}", "");
            // The newline before the line takes no column.
            text.extend(line.drain(..1));
        }
    }
    *text += line.trim_end();
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_break_between_parts_and_colours_take_no_columns() {
        let ink = Ink { colours: true };
        let parts = [
            "stages     world 1.0 us",
            &ink.paint(RED, "broad 2.0 us"),
            "",
            "rest 3.0 us ",
        ]
        .map(str::to_owned);
        let flowed = |width| {
            let mut text = String::new();
            flow(&mut text, &parts, "  ", width);
            text
        };
        assert_eq!(columns(&parts[1]), 12);
        let one = format!("stages     world 1.0 us  {}  rest 3.0 us\n", parts[1]);
        assert_eq!(flowed(usize::MAX), one);
        assert_eq!(flowed(50), one);
        let two = format!(
            "stages     world 1.0 us  {}\n           rest 3.0 us\n",
            parts[1]
        );
        assert_eq!(flowed(49), two);
        assert_eq!(flowed(37), two);
        assert_eq!(flowed(36).lines().count(), 2, "{}", flowed(36));
        assert_eq!(flowed(1).lines().count(), 3);
    }
}
