//! Colours of the classes of points.

/// Colours of the standard classes from 0, in sRGB.
const NAMED: [[u8; 3]; 23] = [
    [150, 150, 158],
    [176, 176, 170],
    [168, 118, 72],
    [176, 208, 96],
    [96, 176, 78],
    [32, 120, 62],
    [212, 84, 66],
    [226, 60, 190],
    [96, 72, 140],
    [66, 134, 204],
    [116, 96, 110],
    [84, 90, 104],
    [214, 186, 120],
    [240, 208, 70],
    [250, 160, 40],
    [62, 62, 76],
    [210, 130, 160],
    [128, 170, 190],
    [255, 40, 120],
    [150, 80, 60],
    [200, 160, 130],
    [226, 240, 250],
    [120, 60, 90],
];
/// In turn of all others.
const OTHERS: [[u8; 3]; 6] = [
    [92, 158, 160],
    [190, 140, 200],
    [140, 150, 84],
    [222, 150, 110],
    [110, 120, 180],
    [180, 104, 128],
];

/// The colour of a class: red, green and blue in sRGB. No two that the standard names are alike.
pub fn class_colour(class: u8) -> [u8; 3] {
    let class = usize::from(class);
    NAMED.get(class).copied().unwrap_or(OTHERS[class % OTHERS.len()])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_can_be_told_apart() {
        let apart =
            |a: [u8; 3], b: [u8; 3]| (0..3).map(|i| u32::from(a[i].abs_diff(b[i]))).sum::<u32>();
        for a in 0..23 {
            for b in 0..a {
                let [of_a, of_b] = [a, b].map(class_colour);
                assert!(apart(of_a, of_b) > 24, "{a} and {b}");
            }
        }
        assert_ne!(class_colour(200), class_colour(201));
        assert_eq!(class_colour(255), OTHERS[255 % 6]);
    }
}
