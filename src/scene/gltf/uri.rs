//! URIs of buffers and images: `data:` with base64, or a path relative to the document (percent-decoded, RFC 3986 §2.1).
//! Refused: every other scheme. Nothing is fetched.

use std::path::{Path, PathBuf};

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

/// What a URI stands for.
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
        if !head.to_ascii_lowercase().ends_with(";base64") {
            return Err("expected a data URI in base64, found another encoding".into());
        }
        let bytes = BASE64.decode(body).map_err(|reason| format!("expected base64, found {reason}"))?;
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

fn percent_decoded(text: &str) -> Result<String, String> {
    let bytes = text.as_bytes();
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while let Some(&byte) = bytes.get(at) {
        let digit = |offset: usize| bytes.get(at + offset).and_then(|&b| char::from(b).to_digit(16));
        // A lone percent sign is not an escape; files written by hand have them in names.
        match (byte, digit(1), digit(2)) {
            (b'%', Some(high), Some(low)) => {
                decoded.push((high * 16 + low) as u8);
                at += 3;
            }
            _ => {
                decoded.push(byte);
                at += 1;
            }
        }
    }
    let decoded = String::from_utf8(decoded).map_err(|_| "expected UTF-8 after percent-decoding, found other bytes")?;
    if decoded.contains('\0') { Err("expected a path, found a NUL byte".into()) } else { Ok(decoded) }
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
        for uri in ["data:application/octet-stream;base64,AAEC/w==", "DATA:;base64,AAEC/w"] {
            assert!(
                matches!(resolve(uri, Path::new("")), Ok(Resource::Inline(bytes)) if bytes == [0, 1, 2, 255]),
                "{uri}"
            );
        }
        for uri in [
            "http://x/y.bin",
            "file:///etc/passwd",
            "data:text/plain,hello",
            "data:;base64,§§",
            "data:;base64",
            "",
            "%00",
            "%ff",
        ] {
            assert!(resolve(uri, Path::new("")).is_err(), "{uri}");
        }
    }
}
