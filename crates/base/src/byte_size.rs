//! Sizes in bytes as people write them.

/// The bytes of a size such as "512M", "4GiB" or "2000000"; `None` if it is invalid. Units are powers of 1024.
///
/// ```
/// assert_eq!(terrane_base::byte_size::parse("1.5k"), Some(1536));
/// ```
pub fn parse(text: &str) -> Option<u64> {
    let lower = text.trim().to_ascii_lowercase();
    let digits = lower.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(lower.len());
    let (value, unit) = (lower[..digits].parse::<f64>().ok()?, lower[digits..].trim());
    let unit = unit.strip_suffix("ib").or(unit.strip_suffix('b')).unwrap_or(unit);
    let shift = ["", "k", "m", "g", "t"].iter().position(|known| *known == unit)?;
    let bytes = value * (1u64 << (10 * shift)) as f64;
    (1.0..1e18).contains(&bytes).then_some(bytes as u64)
}
