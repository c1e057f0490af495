//! A bitmap font for the text under pictures: lowercase letters, digits, comma, point and hyphen.

/// Rows of a letter, tails included, and columns with the gap behind it.
const ROWS: usize = 9;
const COLUMNS: usize = 6;
/// Letters in a row of the sheet.
const LETTERS: usize = 13;

const ALPHABET: &str = "abcdefghijklmnopqrstuvwxyz0123456789,.-";
#[rustfmt::skip]
const SHEET: [&str; 3 * ROWS] = [
    "      #               #         ##        #       #      #  #      ##        ",
    "      #               #        #  #       #                 #       #        ",
    " ###  # ##   ###   ## #  ###   #     #### # ##   ##     ##  #  #    #   ## # ",
    "    # ##  # #   # #  ## #   # ###   #   # ##  #   #      #  # #     #   # # #",
    " #### #   # #     #   # #####  #    #   # #   #   #      #  ##      #   # # #",
    "#   # #   # #   # #   # #      #    #   # #   #   #      #  # #     #   #   #",
    " #### ####   ###   ####  ###   #     #### #   #  ###     #  #  #   ###  #   #",
    "                                        #             #  #                   ",
    "                                     ###               ##                    ",
    "                                     #                                       ",
    "                                     #                                       ",
    "# ##   ###  ####   #### # ##   #### ###   #   # #   # #   # #   # #   # #####",
    "##  # #   # #   # #   # ##  # #      #    #   # #   # #   #  # #  #   #    # ",
    "#   # #   # #   # #   # #      ###   #    #   # #   # # # #   #   #   #   #  ",
    "#   # #   # #   # #   # #         #  #  # #  ##  # #  # # #  # #  #  ##  #   ",
    "#   #  ###  ####   #### #     ####    ##   ## #   #    # #  #   #  ## # #####",
    "            #         #                                               #      ",
    "            #         #                                            ###       ",
    " ###    #    ###   ###     #  #####   ##  #####  ###   ###                   ",
    "#   #  ##   #   # #   #   ##  #      #        # #   # #   #                  ",
    "#  ##   #       #     #  # #  ####  #        #  #   # #   #                  ",
    "# # #   #      #    ##  #  #      # ####    #    ###   ####                  ",
    "##  #   #     #       # #####     # #   #  #    #   #     #              ### ",
    "#   #   #    #    #   #    #  #   # #   #  #    #   #    #    ##   ##        ",
    " ###   ###  #####  ###     #   ###   ###   #     ###   ##     ##   ##        ",
    "                                                               #             ",
    "                                                              #              ",
];

/// Pixels that a line of `text` takes, across and down, with dots of `size` by `size` pixels.
pub fn text_size(text: &str, size: usize) -> [usize; 2] {
    [text.chars().count() * COLUMNS * size, ROWS * size]
}

/// Calls `dot` for each pixel (column, row) that a line of `text` inks; (0, 0) is the upper left. Letters are
/// drawn small, what is not known is left blank. Cost: pixels of [`text_size`].
pub fn write_text(text: &str, size: usize, mut dot: impl FnMut(usize, usize)) {
    for (place, letter) in text.chars().enumerate() {
        let known = ALPHABET.find(letter.to_ascii_lowercase());
        for (col, row) in known.into_iter().flat_map(dots) {
            for (dx, dy) in (0..size * size).map(|i| (i % size, i / size)) {
                dot((place * COLUMNS + col) * size + dx, row * size + dy);
            }
        }
    }
}

/// The dots of a letter, from its place in the alphabet.
fn dots(letter: usize) -> impl Iterator<Item = (usize, usize)> {
    let (first, left) = (letter / LETTERS * ROWS, letter % LETTERS * COLUMNS);
    let all = (0..ROWS).flat_map(|row| (0..COLUMNS).map(move |col| (col, row)));
    all.filter(move |(col, row)| SHEET[first + row].as_bytes().get(left + col) == Some(&b'#'))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(text: &str, size: usize) -> Vec<String> {
        let [width, height] = text_size(text, size);
        let mut picture = vec![vec![b' '; width]; height];
        write_text(text, size, |col, row| picture[row][col] = b'#');
        picture.into_iter().map(|row| String::from_utf8(row).unwrap()).collect()
    }

    #[test]
    fn letters_are_where_the_sheet_has_them_and_no_two_look_alike() {
        assert_eq!(drawn("I1", 1)[0], "  #     #   ");
        assert_eq!(drawn("-", 2)[8..10], ["  ######    ", "  ######    "]);
        let mut looks: Vec<_> = ALPHABET.chars().map(|c| drawn(&c.to_string(), 1)).collect();
        looks.sort();
        looks.dedup();
        assert_eq!(looks.len(), ALPHABET.len());
        assert!(looks.iter().all(|look| look.iter().any(|row| row.contains('#'))));
    }

    #[test]
    fn what_is_not_known_is_blank() {
        assert!(drawn(" \u{e9}%", 1).iter().all(|row| row.trim().is_empty()));
        assert_eq!(drawn("", 3), vec![""; 3 * ROWS]);
    }
}
