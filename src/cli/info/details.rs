//! Format-specific details of a file.

/// Names and values.
pub(crate) fn rows(
    details: &serde_json::Map<String, serde_json::Value>,
) -> impl Iterator<Item = (String, String)> {
    details
        .iter()
        .map(|(name, value)| (name.clone(), value.as_str().unwrap_or_default().to_owned()))
}
