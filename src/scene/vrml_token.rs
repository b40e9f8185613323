//! VRML97 text cut into tokens, each with its line.
//!
//! Knows no node and no field: numbers and names are both words here.

use super::vrml::VrmlRefusal;

/// One token.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Token<'a> {
    /// `{`
    OpenBrace,
    /// `}`
    CloseBrace,
    /// `[`
    OpenBracket,
    /// `]`
    CloseBracket,
    /// A name, keyword or number.
    Word(&'a str),
    /// A quoted string, without its quotes, escapes left as written.
    Text(&'a str),
    /// The end of the file.
    End,
}

impl std::fmt::Display for Token<'_> {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let shorten = |text: &str| text.chars().take(40).collect::<String>();
        match self {
            Token::OpenBrace => out.write_str("`{`"),
            Token::CloseBrace => out.write_str("`}`"),
            Token::OpenBracket => out.write_str("`[`"),
            Token::CloseBracket => out.write_str("`]`"),
            Token::Word(word) => write!(out, "`{}`", shorten(word)),
            Token::Text(text) => write!(out, "the string \"{}\"", shorten(text)),
            Token::End => out.write_str("the end of the file"),
        }
    }
}

/// The tokens of a text, read one by one with one of look-ahead.
pub(super) struct Tokens<'a> {
    text: &'a str,
    at: usize,
    line_at: usize,
    ahead: Option<(Token<'a>, usize)>,
    line: usize,
}

impl<'a> Tokens<'a> {
    /// Starts at the beginning of a text.
    pub(super) fn new(text: &'a str) -> Tokens<'a> {
        // Some editors begin a file with a byte order mark.
        let at = if text.starts_with('\u{feff}') {
            '\u{feff}'.len_utf8()
        } else {
            0
        };
        Tokens {
            text,
            at,
            line_at: 1,
            ahead: None,
            line: 1,
        }
    }

    /// Returns the line of the token read last (1 = first line).
    pub(super) fn line(&self) -> usize {
        self.line
    }

    /// Returns the next token and steps over it.
    pub(super) fn next(&mut self) -> Result<Token<'a>, VrmlRefusal> {
        let (token, line) = match self.ahead.take() {
            Some(ahead) => ahead,
            None => self.read()?,
        };
        self.line = line;
        Ok(token)
    }

    /// Returns the next token without stepping over it.
    pub(super) fn peek(&mut self) -> Result<Token<'a>, VrmlRefusal> {
        if self.ahead.is_none() {
            self.ahead = Some(self.read()?);
        }
        Ok(self.ahead.map_or(Token::End, |(token, _)| token))
    }

    fn read(&mut self) -> Result<(Token<'a>, usize), VrmlRefusal> {
        self.skip_blanks();
        let (start, line) = (self.at, self.line_at);
        let Some(first) = self.text.as_bytes().get(start) else {
            return Ok((Token::End, line));
        };
        self.at += 1;
        let token = match first {
            b'{' => Token::OpenBrace,
            b'}' => Token::CloseBrace,
            b'[' => Token::OpenBracket,
            b']' => Token::CloseBracket,
            b'"' => self.string()?,
            _ => {
                let rest = &self.text.as_bytes()[start..];
                let length = rest
                    .iter()
                    .position(|byte| ends_word(*byte))
                    .unwrap_or(rest.len());
                self.at = start + length;
                Token::Word(&self.text[start..self.at])
            }
        };
        Ok((token, line))
    }

    fn skip_blanks(&mut self) {
        let bytes = self.text.as_bytes();
        let mut in_comment = false;
        while let Some(byte) = bytes.get(self.at) {
            match byte {
                b'\n' => {
                    self.line_at += 1;
                    in_comment = false;
                }
                b'#' => in_comment = true,
                b'\r' => in_comment = false,
                b' ' | b'\t' | b',' => {}
                _ if in_comment => {}
                _ => return,
            }
            self.at += 1;
        }
    }

    fn string(&mut self) -> Result<Token<'a>, VrmlRefusal> {
        let (start, opened) = (self.at, self.line_at);
        let bytes = self.text.as_bytes();
        while let Some(byte) = bytes.get(self.at) {
            match byte {
                b'"' => {
                    let text = &self.text[start..self.at];
                    self.at += 1;
                    return Ok(Token::Text(text));
                }
                b'\\' => {
                    self.at += 1;
                    self.line_at += usize::from(bytes.get(self.at) == Some(&b'\n'));
                }
                b'\n' => self.line_at += 1,
                _ => {}
            }
            self.at += 1;
        }
        Err(VrmlRefusal::at(
            opened,
            "a string opens here and never ends; expected a closing quote",
        ))
    }
}

/// Returns whether a byte cannot be part of a word (all of them are ASCII, so words end on a character).
fn ends_word(byte: u8) -> bool {
    matches!(
        byte,
        b' ' | b'\t' | b'\r' | b'\n' | b',' | b'#' | b'"' | b'{' | b'}' | b'[' | b']'
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expected: &[(Token<'_>, usize)]) {
        let mut tokens = Tokens::new(text);
        for (token, line) in expected {
            assert_eq!(tokens.peek().unwrap(), *token);
            assert_eq!((tokens.next().unwrap(), tokens.line()), (*token, *line));
        }
        assert_eq!(tokens.next().unwrap(), Token::End);
    }

    #[test]
    fn commas_and_comments_are_blanks() {
        check(
            "a,b #c {\n-1.5",
            &[
                (Token::Word("a"), 1),
                (Token::Word("b"), 1),
                (Token::Word("-1.5"), 2),
            ],
        );
        check(
            "x[1]#",
            &[
                (Token::Word("x"), 1),
                (Token::OpenBracket, 1),
                (Token::Word("1"), 1),
                (Token::CloseBracket, 1),
            ],
        );
    }

    #[test]
    fn strings_may_hold_anything_and_span_lines() {
        check(
            "\"{ \\\" é\n}\" z",
            &[(Token::Text("{ \\\" é\n}"), 1), (Token::Word("z"), 2)],
        );
        check(
            "\"a\\\nb\" z",
            &[(Token::Text("a\\\nb"), 1), (Token::Word("z"), 2)],
        );
    }

    #[test]
    fn a_string_without_end_is_refused_where_it_opens() {
        for text in ["\n\"abc\n", "\n\"", "\n\"abc\\"] {
            let refusal = Tokens::new(text).next().unwrap_err();
            assert_eq!(refusal.line, 2, "{text:?}");
        }
    }
}
