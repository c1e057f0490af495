//! Signatures of requests by the keys of Amazon Web Services (Signature Version 4), which other object stores take, too.

use std::time::{SystemTime, UNIX_EPOCH};

use sha2::{Digest, Sha256};

/// Keys of an account.
#[derive(Clone, PartialEq)]
pub(super) struct AwsCredentials {
    id: String,
    secret: String,
    /// Of a session that ends.
    session: Option<String>,
}

impl std::fmt::Debug for AwsCredentials {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "AwsCredentials({})", self.id)
    }
}

impl AwsCredentials {
    /// Those of the environment, if they are set.
    pub(super) fn of(variable: &dyn Fn(&str) -> Option<String>) -> Option<Self> {
        Some(Self {
            id: variable("AWS_ACCESS_KEY_ID")?,
            secret: variable("AWS_SECRET_ACCESS_KEY")?,
            session: variable("AWS_SESSION_TOKEN"),
        })
    }
}

/// The digest of the body, which is not signed.
const UNSIGNED: &str = "UNSIGNED-PAYLOAD";

/// A request for an object at a time.
pub(super) struct SigV4Request<'a> {
    /// Host, path and query of the address.
    host: &'a str,
    path: &'a str,
    query: &'a str,
    region: &'a str,
    /// As `20151231T235959Z`.
    time: String,
}

impl<'a> SigV4Request<'a> {
    /// A request that is made now.
    pub(super) fn now(url: &'a str, region: &'a str) -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self::at(url, region, since.as_secs())
    }

    /// A request at a number of seconds since 1970.
    fn at(url: &'a str, region: &'a str, seconds: u64) -> Self {
        let rest = url.split_once("://").map_or(url, |(_, rest)| rest);
        let (place, query) = rest.split_once('?').unwrap_or((rest, ""));
        let (host, path) = place.find('/').map_or((place, "/"), |at| place.split_at(at));
        Self { host, path, query, region, time: time_text(seconds) }
    }

    /// The headers of the signed request.
    pub(super) fn headers(&self, keys: &AwsCredentials) -> Vec<(&'static str, String)> {
        let mut headers =
            vec![("x-amz-date", self.time.clone()), ("x-amz-content-sha256", UNSIGNED.to_owned())];
        headers.extend(keys.session.clone().map(|token| ("x-amz-security-token", token)));
        let mut signed = headers.clone();
        signed.push(("host", self.host.to_owned()));
        signed.sort();
        let names: Vec<_> = signed.iter().map(|(name, _)| *name).collect();
        let names = names.join(";");
        let lines: String =
            signed.iter().map(|(name, value)| format!("{name}:{value}\n")).collect();
        let request = format!(
            "GET\n{}\n{}\n{lines}\n{names}\n{UNSIGNED}",
            self.path,
            canonical_query(self.query)
        );
        let day = &self.time[..8];
        let scope = format!("{day}/{}/s3/aws4_request", self.region);
        let digest = hex(&Sha256::digest(request));
        let text = format!("AWS4-HMAC-SHA256\n{}\n{scope}\n{digest}", self.time);
        let key = [day, self.region, "s3", "aws4_request"]
            .iter()
            .fold(format!("AWS4{}", keys.secret).into_bytes(), |key, part| hmac(&key, part));
        let signature = hex(&hmac(&key, &text));
        let credential = format!("{}/{scope}", keys.id);
        headers.push((
            "authorization",
            format!(
                "AWS4-HMAC-SHA256 Credential={credential}, SignedHeaders={names}, Signature={signature}"
            ),
        ));
        headers
    }
}

/// The parts of a query in order, each with a value.
fn canonical_query(query: &str) -> String {
    let parts = query.split('&').filter(|part| !part.is_empty());
    let mut parts: Vec<_> = parts
        .map(|part| if part.contains('=') { part.to_owned() } else { format!("{part}=") })
        .collect();
    parts.sort();
    parts.join("&")
}

/// HMAC with SHA-256 (RFC 2104).
fn hmac(key: &[u8], text: &str) -> Vec<u8> {
    const BLOCK: usize = 64;
    let mut block = [0; BLOCK];
    match key.len() > BLOCK {
        true => block[..32].copy_from_slice(&Sha256::digest(key)),
        false => block[..key.len()].copy_from_slice(key),
    }
    let inner = Sha256::new_with_prefix(block.map(|byte| byte ^ 0x36)).chain_update(text);
    let outer = Sha256::new_with_prefix(block.map(|byte| byte ^ 0x5c));
    outer.chain_update(inner.finalize()).finalize().to_vec()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Seconds since 1970 as year, month, day and time.
fn time_text(seconds: u64) -> String {
    let (days, rest) = (seconds / 86_400, seconds % 86_400);
    // Years begin in March, so that leap days are last (Hinnant, "chrono-compatible low-level date algorithms").
    let shifted = days + 719_468;
    let (era, of_era) = (shifted / 146_097, shifted % 146_097);
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = year + 400 * era + u64::from(month <= 2);
    let [hour, minute, second] = [rest / 3600, rest / 60 % 60, rest % 60];
    format!("{year:04}{month:02}{day:02}T{hour:02}{minute:02}{second:02}Z")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_dates() {
        for (seconds, text) in [
            (0, "19700101T000000Z"),
            (951_827_696, "20000229T123456Z"),
            (1_369_353_600, "20130524T000000Z"),
            (4_107_542_399, "21000228T235959Z"),
            (4_107_542_400, "21000301T000000Z"),
        ] {
            assert_eq!(time_text(seconds), text);
        }
    }

    #[test]
    fn codes_are_those_of_rfc_4231() {
        let found = hex(&hmac(&[0x0b; 20], "Hi There"));
        assert_eq!(found, "b0344c61d8db38535ca8afceaf0bf12b881dc200c9833da726e9376c2e32cff7");
        let found =
            hex(&hmac(&[0xaa; 131], "Test Using Larger Than Block-Size Key - Hash Key First"));
        assert_eq!(found, "60e431591ee0b67f0d8a26aacbf5b77f8e0bc6213728c5140546040f0ee37f54");
    }

    #[test]
    fn a_signature_depends_on_all_that_is_asked() {
        let keys = |session: Option<&str>| AwsCredentials {
            id: "ID".to_owned(),
            secret: "secret".to_owned(),
            session: session.map(str::to_owned),
        };
        let signed = |url: &str, region: &str, seconds, session| {
            let headers = SigV4Request::at(url, region, seconds).headers(&keys(session));
            headers.last().unwrap().1.clone()
        };
        let first = signed("https://b.s3.amazonaws.com/k", "r", 9, None);
        assert!(first.starts_with(
            "AWS4-HMAC-SHA256 Credential=ID/19700101/r/s3/aws4_request, SignedHeaders=host;"
        ));
        let mut all = vec![
            first,
            signed("https://c.s3.amazonaws.com/k", "r", 9, None),
            signed("https://b.s3.amazonaws.com/l", "r", 9, None),
            signed("https://b.s3.amazonaws.com/k?v=1", "r", 9, None),
            signed("https://b.s3.amazonaws.com/k", "s", 9, None),
            signed("https://b.s3.amazonaws.com/k", "r", 10, None),
            signed("https://b.s3.amazonaws.com/k", "r", 9, Some("t")),
        ];
        all.sort();
        all.dedup();
        assert_eq!(all.len(), 7);
        assert_eq!(canonical_query("b=2&a&c="), "a=&b=2&c=");
    }
}
