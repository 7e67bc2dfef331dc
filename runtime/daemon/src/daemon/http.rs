//! HTTP/1.1 for an endpoint that only has pages: parsed requests, and responses that close their connection.

/// The longest request line with its headers, in bytes.
pub(super) const REQUEST_MAX: usize = 8 * 1_024;
/// The most headers of a request.
const HEADERS_MAX: usize = 64;

/// The start of a request. Headers and body are not used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Request {
    /// Without the query.
    pub(super) path: String,
    method: Method,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Method {
    Get,
    /// As GET, but the response has no body.
    Head,
    Other,
}

/// What some received bytes hold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Parsed {
    /// The request is not complete.
    Incomplete,
    /// A request.
    Request(Request),
    /// No request can begin like this.
    Invalid,
}

/// Parses the bytes received so far.
pub(super) fn parse(bytes: &[u8]) -> Parsed {
    let mut headers = [httparse::EMPTY_HEADER; HEADERS_MAX];
    let mut request = httparse::Request::new(&mut headers);
    match request.parse(bytes) {
        Ok(httparse::Status::Partial) => Parsed::Incomplete,
        Ok(httparse::Status::Complete(_)) => {
            let target = request.path.unwrap_or_default();
            Parsed::Request(Request {
                path: target.split('?').next().unwrap_or_default().to_owned(),
                method: match request.method {
                    Some("GET") => Method::Get,
                    Some("HEAD") => Method::Head,
                    _ => Method::Other,
                },
            })
        }
        Err(_) => Parsed::Invalid,
    }
}

/// Status code and reason of a response.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Status(u16, &'static str);

impl Status {
    pub(super) const OK: Self = Self(200, "OK");
    pub(super) const BAD_REQUEST: Self = Self(400, "Bad Request");
    pub(super) const NOT_FOUND: Self = Self(404, "Not Found");
    const METHOD_NOT_ALLOWED: Self = Self(405, "Method Not Allowed");
    pub(super) const TOO_LARGE: Self = Self(431, "Request Header Fields Too Large");
    pub(super) const INTERNAL_ERROR: Self = Self(500, "Internal Server Error");
    pub(super) const UNAVAILABLE: Self = Self(503, "Service Unavailable");
}

/// A page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Page {
    pub(super) status: Status,
    pub(super) content_type: &'static str,
    pub(super) body: Vec<u8>,
}

impl Page {
    /// A response without a page.
    pub(super) const fn empty(status: Status) -> Self {
        Self {
            status,
            content_type: "text/plain; charset=utf-8",
            body: Vec::new(),
        }
    }

    /// The response with this page.
    pub(super) fn response(&self) -> Vec<u8> {
        let mut response = self.head();
        response.extend_from_slice(&self.body);
        response
    }

    fn head(&self) -> Vec<u8> {
        let Self {
            status: Status(code, reason),
            content_type,
            body,
        } = self;
        let length = body.len();
        let allow = if *code == Status::METHOD_NOT_ALLOWED.0 {
            "allow: GET, HEAD\r\n"
        } else {
            ""
        };
        format!(
            "HTTP/1.1 {code} {reason}\r\ncontent-type: {content_type}\r\ncontent-length: {length}\r\n{allow}connection: close\r\n\r\n"
        )
        .into_bytes()
    }
}

impl Request {
    /// The response, with `page` for the path; `None` if there is no such page.
    pub(super) fn response(&self, page: Option<Page>) -> Vec<u8> {
        match (page, self.method) {
            (None, _) => Page::empty(Status::NOT_FOUND).response(),
            (Some(_), Method::Other) => Page::empty(Status::METHOD_NOT_ALLOWED).response(),
            (Some(page), Method::Get) => page.response(),
            (Some(page), Method::Head) => page.head(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(text: &str) -> Request {
        match parse(text.as_bytes()) {
            Parsed::Request(request) => request,
            other => panic!("{text:?}: {other:?}"),
        }
    }

    fn page() -> Page {
        Page {
            status: Status::OK,
            content_type: "application/json",
            body: b"{}".to_vec(),
        }
    }

    #[test]
    fn request_is_complete_with_its_last_header_only() {
        let text = "GET /status?since=3 HTTP/1.1\r\nHost: drone\r\n\r\n";
        for end in 0..text.len() {
            assert_eq!(parse(&text.as_bytes()[..end]), Parsed::Incomplete, "{end}");
        }
        assert_eq!(request(text).path, "/status");
    }

    #[test]
    fn bytes_that_are_no_request_are_refused() {
        let many = "x: y\r\n".repeat(HEADERS_MAX + 1);
        for text in [
            "\u{1}\u{2}",
            "GET\r\n\r\n",
            "GET / SPDY/3\r\n\r\n",
            &format!("GET / HTTP/1.1\r\n{many}\r\n"),
        ] {
            assert_eq!(parse(text.as_bytes()), Parsed::Invalid, "{text:?}");
        }
    }

    #[test]
    fn response_tells_its_length_and_closes_the_connection() {
        let get = request("GET /status HTTP/1.1\r\n\r\n");
        let head = "HTTP/1.1 200 OK\r\ncontent-type: application/json\r\ncontent-length: 2\r\nconnection: close\r\n\r\n";
        let response = get.response(Some(page()));
        assert_eq!(String::from_utf8(response).unwrap(), format!("{head}{{}}"));
        let response = request("HEAD /status HTTP/1.0\r\n\r\n").response(Some(page()));
        assert_eq!(String::from_utf8(response).unwrap(), head);
    }

    #[test]
    fn unknown_pages_and_other_methods_are_refused() {
        let begins = |request: &str, page, line: &str| {
            let response = self::request(request).response(page);
            let response = String::from_utf8(response).unwrap();
            assert!(response.starts_with(line), "{response}");
        };
        begins(
            "GET /x HTTP/1.1\r\n\r\n",
            None,
            "HTTP/1.1 404 Not Found\r\n",
        );
        let line = "HTTP/1.1 405 Method Not Allowed\r\n";
        begins("POST /status HTTP/1.1\r\n\r\n", Some(page()), line);
    }
}
