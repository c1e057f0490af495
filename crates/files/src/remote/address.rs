//! URLs of remote files, and the HTTP requests for them.

use std::path::Path;

use super::signature::{AwsCredentials, SigV4Request};
use terrane_base::error::{Error, Result};

/// Region of Amazon S3, unless another is set.
const REGION: &str = "us-east-1";

/// The HTTP URL of a remote file, and what authorizes requests.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RemoteUrl {
    /// Scheme, host, path and query, percent-encoded.
    pub(super) url: String,
    pub(super) authorization: Authorization,
}

/// What authorizes a request.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Authorization {
    /// Nothing, or a signature in the URL.
    Anonymous,
    /// The header `Authorization: Bearer`.
    Bearer(String),
    /// Signature Version 4 of Amazon Web Services.
    SigV4 { keys: AwsCredentials, region: String },
}

/// A variable of the environment that is set and not empty.
type Environment<'a> = &'a dyn Fn(&str) -> Option<String>;

impl RemoteUrl {
    /// Whether a path is a URL that can be read.
    pub(super) fn is_supported(path: &Path) -> bool {
        path.to_str().is_some_and(|name| split(name).is_some())
    }

    /// The URL of a path: `http`, `https`, `s3`, `gs`, `az`, and the `/vsi` names of GDAL for them.
    ///
    /// # Errors
    /// Other URLs; no bucket and key; no storage account.
    pub(super) fn parse(path: &Path, variable: Environment<'_>) -> Result<Self> {
        let name = path.to_str().and_then(split);
        let Some((scheme, rest)) = name else {
            return Err(Error::missing(path));
        };
        match scheme {
            "s3" => s3(path, rest, variable),
            "gs" => {
                let [bucket, key] = bucket_and_key(path, scheme, rest)?;
                let token = variable("GOOGLE_OAUTH_ACCESS_TOKEN");
                Ok(Self {
                    url: format!("https://storage.googleapis.com/{bucket}/{}", encoded(key)),
                    authorization: token.map_or(Authorization::Anonymous, Authorization::Bearer),
                })
            }
            "az" => {
                let [container, key] = bucket_and_key(path, scheme, rest)?;
                let account = variable("AZURE_STORAGE_ACCOUNT").ok_or_else(|| {
                    Error::usage("the storage account is not known")
                        .in_file(path)
                        .remedy("set AZURE_STORAGE_ACCOUNT, or pass the https URL")
                })?;
                let token = variable("AZURE_STORAGE_SAS_TOKEN");
                let query = token.map(|token| format!("?{}", token.trim_start_matches('?')));
                Ok(Self {
                    url: format!(
                        "https://{account}.blob.core.windows.net/{container}/{}{}",
                        encoded(key),
                        query.unwrap_or_default()
                    ),
                    authorization: Authorization::Anonymous,
                })
            }
            _ => Ok(Self {
                url: format!("{scheme}://{}", rest.replace(' ', "%20")),
                authorization: Authorization::Anonymous,
            }),
        }
    }

    /// The headers that authorize a request for it.
    pub(super) fn headers(&self) -> Vec<(&'static str, String)> {
        match &self.authorization {
            Authorization::Anonymous => Vec::new(),
            Authorization::Bearer(token) => vec![("authorization", format!("Bearer {token}"))],
            Authorization::SigV4 { keys, region } => {
                SigV4Request::now(&self.url, region).headers(keys)
            }
        }
    }
}

/// Scheme and rest of a URL that can be read.
fn split(name: &str) -> Option<(&'static str, &str)> {
    const SCHEMES: [&str; 5] = ["http", "https", "s3", "gs", "az"];
    const OF_GDAL: [(&str, &str); 3] = [("/vsis3/", "s3"), ("/vsigs/", "gs"), ("/vsiaz/", "az")];
    if let Some(rest) = name.strip_prefix("/vsicurl/") {
        return split(rest);
    }
    if let Some((prefix, scheme)) = OF_GDAL.iter().find(|(prefix, _)| name.starts_with(prefix)) {
        return Some((scheme, &name[prefix.len()..]));
    }
    let (scheme, rest) = name.split_once("://")?;
    let known = SCHEMES.iter().find(|known| known.eq_ignore_ascii_case(scheme))?;
    Some((known, rest))
}

/// The request for an object of S3: at the host of its bucket, or by path where another server is set.
fn s3(path: &Path, rest: &str, variable: Environment<'_>) -> Result<RemoteUrl> {
    let [bucket, key] = bucket_and_key(path, "s3", rest)?;
    let region = variable("AWS_REGION").or_else(|| variable("AWS_DEFAULT_REGION"));
    let region = region.unwrap_or_else(|| REGION.to_owned());
    let server = variable("AWS_ENDPOINT_URL_S3").or_else(|| variable("AWS_ENDPOINT_URL"));
    let key = encoded(key);
    let url = match server {
        Some(server) => format!("{}/{bucket}/{key}", server.trim_end_matches('/')),
        // Certificates are for one name below the host.
        None if bucket.contains('.') => {
            format!("https://s3.{region}.amazonaws.com/{bucket}/{key}")
        }
        None => format!("https://{bucket}.s3.{region}.amazonaws.com/{key}"),
    };
    let is_anonymous = variable("AWS_NO_SIGN_REQUEST").is_some_and(|value| {
        ["yes", "true", "1"].iter().any(|yes| value.eq_ignore_ascii_case(yes))
    });
    let keys = AwsCredentials::of(variable).filter(|_| !is_anonymous);
    let authorization =
        keys.map_or(Authorization::Anonymous, |keys| Authorization::SigV4 { keys, region });
    Ok(RemoteUrl { url, authorization })
}

fn bucket_and_key<'a>(path: &Path, scheme: &str, rest: &'a str) -> Result<[&'a str; 2]> {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._".contains(&byte);
    match rest.split_once('/') {
        // Other characters would name another host.
        Some((bucket, key))
            if !bucket.is_empty() && !key.is_empty() && bucket.bytes().all(is_plain) =>
        {
            Ok([bucket, key])
        }
        _ => Err(Error::usage("expected BUCKET/KEY after the scheme")
            .in_file(path)
            .remedy(format!("write it as {scheme}://BUCKET/KEY"))),
    }
}

/// A key with all but unreserved characters and slashes percent-encoded.
fn encoded(key: &str) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~/".contains(&byte);
    key.bytes()
        .map(|byte| match is_plain(byte) {
            true => char::from(byte).to_string(),
            false => format!("%{byte:02X}"),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn url(name: &str, set: &[(&str, &str)]) -> String {
        let variable = |asked: &str| {
            set.iter().find(|(name, _)| *name == asked).map(|(_, value)| (*value).to_owned())
        };
        match RemoteUrl::parse(Path::new(name), &variable) {
            Ok(address) => address.url,
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn names_stand_for_requests() {
        for (name, set, expected) in [
            ("https://h/a.tif?x=1&y=*", &[][..], "https://h/a.tif?x=1&y=*"),
            ("/vsicurl/HTTP://h/a b.tif", &[], "http://h/a%20b.tif"),
            (
                "s3://b/k/a+b é.tif",
                &[],
                "https://b.s3.us-east-1.amazonaws.com/k/a%2Bb%20%C3%A9.tif",
            ),
            ("/vsis3/b/k", &[("AWS_REGION", "x")], "https://b.s3.x.amazonaws.com/k"),
            ("s3://b.c/k", &[("AWS_DEFAULT_REGION", "x")], "https://s3.x.amazonaws.com/b.c/k"),
            ("s3://b/k", &[("AWS_ENDPOINT_URL", "http://h:1/")], "http://h:1/b/k"),
            ("gs://b/k/l", &[], "https://storage.googleapis.com/b/k/l"),
            (
                "az://c/k",
                &[("AZURE_STORAGE_ACCOUNT", "me"), ("AZURE_STORAGE_SAS_TOKEN", "?sig=1")],
                "https://me.blob.core.windows.net/c/k?sig=1",
            ),
        ] {
            assert_eq!(url(name, set), expected);
            assert!(RemoteUrl::is_supported(Path::new(name)));
        }
        assert!(url("az://c/k", &[]).contains("AZURE_STORAGE_ACCOUNT"));
        for name in ["s3://b", "s3://b/", "s3://evil:80#/k", "gs://a@b/k"] {
            assert!(url(name, &[]).contains("://BUCKET/KEY"), "{name}");
        }
        for name in ["ftp://h/a", "/vsizip/a.zip", "a.tif", "C:\\a", "https:/h/a"] {
            assert!(!RemoteUrl::is_supported(Path::new(name)), "{name}");
        }
    }

    #[test]
    fn keys_sign_unless_they_are_not_to() {
        let set = |more: Option<&'static str>| {
            move |name: &str| match name {
                "AWS_ACCESS_KEY_ID" | "AWS_SECRET_ACCESS_KEY" => Some("k".to_owned()),
                "AWS_NO_SIGN_REQUEST" => more.map(str::to_owned),
                _ => None,
            }
        };
        let of = |more| RemoteUrl::parse(Path::new("s3://b/k"), &set(more)).unwrap();
        assert!(matches!(of(None).authorization, Authorization::SigV4 { .. }));
        assert_eq!(of(Some("YES")).authorization, Authorization::Anonymous);
        let names: Vec<_> = of(None).headers().into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["x-amz-date", "x-amz-content-sha256", "authorization"]);
    }
}
