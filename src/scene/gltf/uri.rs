//! URIs of buffers and images: `data:` (RFC 2397, in base64 or not), or a path relative to the document
//! (percent-decoded, RFC 3986 §2.1). Refused: every other scheme. Nothing is fetched.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::percent_decode_str;

/// What a URI refers to.
#[derive(Debug)]
pub(super) enum Resource {
    /// Bytes inside the URI.
    Inline(Vec<u8>),
    /// A file; absolute, or relative to the working directory.
    File(PathBuf),
}

/// Some exporters leave the padding out.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Resolves `uri` against the directory of the document. The error says what was expected and found.
pub(super) fn resolve(uri: &str, directory: &Path) -> Result<Resource, String> {
    if uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:")) {
        let (head, body) = uri[5..].split_once(',').ok_or("expected a comma in the data URI, found none")?;
        // Borrowed, and without a copy, where nothing is escaped.
        let bytes: Cow<[u8]> = percent_decode_str(body).into();
        if !head.to_ascii_lowercase().ends_with(";base64") {
            return Ok(Resource::Inline(bytes.into_owned()));
        }
        let bytes = BASE64.decode(bytes).map_err(|reason| format!("expected base64, found {reason}"))?;
        return Ok(Resource::Inline(bytes));
    }
    if let Some(scheme) = scheme(uri) {
        return Err(format!("expected a relative path or a data URI, found the scheme `{scheme}`"));
    }
    if uri.is_empty() {
        return Err("expected a relative path or a data URI, found an empty string".into());
    }
    Ok(Resource::File(directory.join(percent_decoded(uri)?)))
}

/// The scheme of an absolute URI (RFC 3986 §3.1).
fn scheme(uri: &str) -> Option<&str> {
    let (scheme, _) = uri.split_once(':')?;
    let mut characters = scheme.chars();
    let starts = characters.next()?.is_ascii_alphabetic();
    (starts && characters.all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))).then_some(scheme)
}

/// A lone percent sign is no escape and stays: files written by hand have them in names.
fn percent_decoded(text: &str) -> Result<String, String> {
    let decoded = percent_decode_str(text).decode_utf8();
    let decoded = decoded.map_err(|_| "expected UTF-8 after percent-decoding, found other bytes")?;
    if decoded.contains('\0') { Err("expected a path, found a NUL byte".into()) } else { Ok(decoded.into_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: RFC 3986 and 4648 by hand. No randomness.
    #[test]
    fn resolves_what_gltf_allows_and_refuses_the_rest() {
        let file = |uri: &str| match resolve(uri, Path::new("/scenes")) {
            Ok(Resource::File(path)) => path,
            other => panic!("{uri}: {other:?}"),
        };
        assert_eq!(file("a%20b/%C3%A4.bin"), Path::new("/scenes/a b/ä.bin"));
        assert_eq!(file("../x.bin"), Path::new("/scenes/../x.bin"));
        assert_eq!(file("100%.bin"), Path::new("/scenes/100%.bin"));
        for uri in [
            "data:application/octet-stream;base64,AAEC/w==",
            "DATA:;base64,AAEC/w",
            "data:;base64,AAEC%2Fw%3D%3D",
            "data:,%00%01%02%FF",
        ] {
            assert!(
                matches!(resolve(uri, Path::new("")), Ok(Resource::Inline(bytes)) if bytes == [0, 1, 2, 255]),
                "{uri}"
            );
        }
        for uri in ["http://x/y.bin", "file:///etc/passwd", "data:;base64,§§", "data:;base64", "", "%00", "%ff"] {
            assert!(resolve(uri, Path::new("")).is_err(), "{uri}");
        }
    }
}
