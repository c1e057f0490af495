//! Names of classes (ASPRS LAS 1.4 R15, tables 9 and 17).

/// Names of the classes from 0; classes dropped in newer point formats have their old names.
const NAMES: [&str; 23] = [
    "never classified",
    "unclassified",
    "ground",
    "low vegetation",
    "medium vegetation",
    "high vegetation",
    "building",
    "low point (noise)",
    "model key-point",
    "water",
    "rail",
    "road surface",
    "overlap",
    "wire: guard",
    "wire: conductor",
    "transmission tower",
    "wire: connector",
    "bridge deck",
    "high noise",
    "overhead structure",
    "ignored ground",
    "snow",
    "temporal exclusion",
];
/// The first user definable class.
const FIRST_OWN: u8 = 64;

/// Standard name of a class.
pub fn class_name(class: u8) -> &'static str {
    let other = if class < FIRST_OWN { "reserved" } else { "user definable" };
    NAMES.get(usize::from(class)).copied().unwrap_or(other)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_have_the_names_of_the_standard() {
        let told = [0, 2, 6, 9, 17, 22, 23, 63, 64, 255].map(class_name);
        let names = ["never classified", "ground", "building", "water", "bridge deck"];
        assert_eq!(told[..5], names);
        let others = ["temporal exclusion", "reserved", "reserved"];
        assert_eq!(told[5..8], others);
        assert_eq!(told[8..], ["user definable"; 2]);
    }
}
