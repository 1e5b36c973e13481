//! Access control: an address with the right token, under a name of this machine, from a page of
//! this server.

use std::net::SocketAddr;

use rand::TryRngCore;
use rand::rngs::OsRng;

use crate::error::PlayError;

/// Random bytes of a token.
const TOKEN_BYTES: usize = 16;

/// A fresh token: 128 random bits of the system as 32 hexadecimal digits.
///
/// # Errors
/// If the system gives none.
pub fn token() -> Result<String, PlayError> {
    let mut bytes = [0; TOKEN_BYTES];
    (OsRng.try_fill_bytes(&mut bytes)).map_err(|e| PlayError::Token(e.to_string()))?;
    Ok(bytes.iter().map(|b| format!("{b:02x}")).collect())
}

/// The rules.
#[derive(Debug, Clone)]
pub(crate) struct Access {
    pub(crate) token: String,
    pub(crate) address: SocketAddr,
    /// Pages of this machine may show the page in a frame.
    pub(crate) embed: bool,
}

impl Access {
    /// What follows the token in a request's path; `None` if it does not begin with it.
    pub(crate) fn after_token<'p>(&self, path: &'p str) -> Option<&'p str> {
        let rest = path.strip_prefix('/')?;
        let (token, rest) = rest.split_once('/')?;
        same(token.as_bytes(), self.token.as_bytes()).then_some(rest)
    }

    /// Whether a request may name this host: numbers, or `localhost`, and this server's port. A
    /// name of somebody else's that leads here is refused, whatever it resolves to.
    pub(crate) fn is_own_host(&self, host: &str) -> bool {
        if let Some(port) = host.strip_prefix("localhost:") {
            return port.parse() == Ok(self.address.port());
        }
        let Ok(named) = host.parse::<SocketAddr>() else {
            return false;
        };
        let reachable = named.ip().is_loopback() || !self.address.ip().is_loopback();
        reachable && named.port() == self.address.port()
    }

    /// Whether a page from `origin` may ask under the name `host`: its own pages only.
    pub(crate) fn is_own_origin(&self, origin: &str, host: &str) -> bool {
        origin.strip_prefix("http://") == Some(host)
    }
}

/// Compares in constant time.
fn same(a: &[u8], b: &[u8]) -> bool {
    let differ = a.iter().zip(b).fold(0, |differ, (x, y)| differ | (x ^ y));
    a.len() == b.len() && differ == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn access(address: &str) -> Access {
        Access {
            token: "0123abcd".to_owned(),
            address: address.parse().unwrap(),
            embed: false,
        }
    }

    #[test]
    fn tokens_are_long_and_never_the_same() {
        let [a, b] = [token().unwrap(), token().unwrap()];
        assert!(a.len() == 32 && a.bytes().all(|c| c.is_ascii_hexdigit()));
        assert_ne!(a, b);
    }

    #[test]
    fn only_the_whole_token_opens() {
        let access = access("127.0.0.1:4000");
        assert_eq!(access.after_token("/0123abcd/"), Some(""));
        assert_eq!(access.after_token("/0123abcd/mesh/0"), Some("mesh/0"));
        for wrong in [
            "",
            "/",
            "//",
            "/0123abcd",
            "/0123abc/",
            "/0123abcde/",
            "/0123ABCD/",
            "0123abcd/",
            "/x/0123abcd/",
        ] {
            assert_eq!(access.after_token(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn hosts_are_numbers_or_localhost_with_the_port() {
        let here = access("127.0.0.1:4000");
        for good in ["127.0.0.1:4000", "localhost:4000", "[::1]:4000"] {
            assert!(here.is_own_host(good), "{good}");
        }
        for bad in [
            "",
            "127.0.0.1",
            "127.0.0.1:80",
            "localhost",
            "localhost:80",
            "localhost.evil.com:4000",
            "evil.com:4000",
            "192.168.0.7:4000",
        ] {
            assert!(!here.is_own_host(bad), "{bad}");
        }
        let open = access("0.0.0.0:4000");
        assert!(open.is_own_host("192.168.0.7:4000") && !open.is_own_host("evil.com:4000"));
    }

    #[test]
    fn origins_are_the_page_itself() {
        let here = access("127.0.0.1:4000");
        assert!(here.is_own_origin("http://localhost:4000", "localhost:4000"));
        for bad in [
            "null",
            "https://localhost:4000",
            "http://localhost:8888",
            "",
        ] {
            assert!(!here.is_own_origin(bad, "localhost:4000"), "{bad}");
        }
    }
}
