//! VRML97 statements, grouping nodes and values; geometry is in `vrml_geometry`.
//!
//! Nodes and fields that mean nothing to us are skipped by matching brackets, whatever is in them.

use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;

use super::affine::{Affine, Xyz};
use super::primitive::Solid;
use super::vrml::{MAX_LEVELS, VrmlReader, VrmlRefusal};
use super::vrml_fields::strange_field;
use super::vrml_token::{Token, Tokens};
use super::vrml_tree::NodeKind;

/// What a DEF name stands for.
#[derive(Clone)]
pub(super) enum Named {
    /// A node that is still being read.
    Open,
    /// A node that can stand among children.
    Node(usize),
    /// A geometry.
    Geometry(Rc<Solid>),
    /// A Coordinate node.
    Points(Rc<Vec<Xyz>>),
    /// Something that was skipped.
    Skipped,
}

/// Reads one file.
pub(super) struct Parser<'a, 'r, 'l> {
    pub(super) tokens: Tokens<'a>,
    pub(super) file: Arc<str>,
    pub(super) reading: &'r mut VrmlReader<'l>,
    names: BTreeMap<&'a str, Named>,
    level: usize,
}

impl<'a, 'r, 'l> Parser<'a, 'r, 'l> {
    /// Starts at the beginning of a file that stands `level` nodes deep.
    pub(super) fn new(
        text: &'a str,
        file: &str,
        level: usize,
        reading: &'r mut VrmlReader<'l>,
    ) -> Self {
        Parser {
            tokens: Tokens::new(text),
            file: Arc::from(file),
            reading,
            names: BTreeMap::new(),
            level,
        }
    }

    /// Reads the whole file and gives its root nodes.
    pub(super) fn roots(mut self) -> Result<Vec<usize>, VrmlRefusal> {
        let mut roots = Vec::new();
        while self.tokens.peek()? != Token::End {
            roots.extend(self.statement()?);
        }
        self.reading.tree.check_roots(&roots, self.tokens.line())?;
        Ok(roots)
    }

    /// Reads a node or another statement; `None` when it is nothing to us.
    fn statement(&mut self) -> Result<Option<usize>, VrmlRefusal> {
        let word = self.word("a node")?;
        if self.other_statement(word)? {
            return Ok(None);
        }
        match word {
            "NULL" => Ok(None),
            "USE" => self.used_node(),
            "DEF" => {
                let name = self.word("a name after DEF")?;
                let node_type = self.word("a node type after DEF and its name")?;
                self.names.insert(name, Named::Open);
                let node = self.node(node_type, Some(name))?;
                self.names
                    .insert(name, node.map_or(Named::Skipped, Named::Node));
                Ok(node)
            }
            _ => self.node(word, None),
        }
    }

    /// Skips PROTO, EXTERNPROTO and ROUTE statements; returns whether the word began one.
    pub(super) fn other_statement(&mut self, word: &str) -> Result<bool, VrmlRefusal> {
        if !matches!(word, "PROTO" | "EXTERNPROTO" | "ROUTE") {
            return Ok(false);
        }
        self.warn_skipped(word);
        let name = self.word("a name")?;
        match word {
            "ROUTE" => {
                if self.word("TO")? != "TO" {
                    return Err(self.refuse(format!("expected `TO` in the ROUTE from `{name}`")));
                }
                self.word("where the ROUTE goes")?;
            }
            "PROTO" => {
                self.skip_block(Token::OpenBracket)?;
                self.skip_block(Token::OpenBrace)?;
            }
            _ => {
                self.skip_block(Token::OpenBracket)?;
                self.skip_value("EXTERNPROTO")?;
            }
        }
        Ok(true)
    }

    fn used_node(&mut self) -> Result<Option<usize>, VrmlRefusal> {
        let name = self.word("a name after USE")?;
        match self.named(name)? {
            Named::Node(node) => Ok(Some(node)),
            Named::Skipped => Ok(None),
            Named::Open | Named::Geometry(_) | Named::Points(_) => Err(self.refuse(format!(
                "`{name}` is no node that can stand here; expected a Shape or a group"
            ))),
        }
    }

    /// Returns what a name stands for; refuses unknown names and names inside their own DEF.
    pub(super) fn named(&self, name: &str) -> Result<Named, VrmlRefusal> {
        match self.names.get(name) {
            Some(Named::Open) => {
                Err(self.refuse(format!("USE of `{name}` inside its own DEF, without end")))
            }
            Some(named) => Ok(named.clone()),
            None => Err(self.refuse(format!(
                "USE of `{name}`, but no DEF of this name stands before"
            ))),
        }
    }

    /// Remembers what a name stands for.
    pub(super) fn name(&mut self, name: &'a str, named: Named) {
        self.names.insert(name, named);
    }

    fn node(
        &mut self,
        node_type: &'a str,
        name: Option<&'a str>,
    ) -> Result<Option<usize>, VrmlRefusal> {
        let line = self.tokens.line();
        self.level += 1;
        if self.level > MAX_LEVELS {
            return Err(self.refuse(format!(
                "nodes are nested deeper than {MAX_LEVELS} levels; expected fewer"
            )));
        }
        let kind = match node_type {
            "Transform" => Some(self.transform()?),
            "Group" | "Collision" => Some(self.group(node_type)?),
            "Shape" => self.shape()?,
            "Inline" => Some(self.inline()?),
            _ => {
                self.warn_skipped(node_type);
                self.skip_block(Token::OpenBrace)?;
                None
            }
        };
        self.level -= 1;
        let name: Option<Arc<str>> = name.map(Arc::from);
        kind.map(|kind| self.reading.tree.add(name, &self.file, line, kind))
            .transpose()
    }

    fn group(&mut self, node_type: &str) -> Result<NodeKind, VrmlRefusal> {
        let mut children = Vec::new();
        self.body(node_type, |parser, field| {
            let known = field == "children";
            if known {
                children.extend(parser.children()?);
            }
            Ok(known)
        })?;
        Ok(NodeKind::Group {
            map: Affine::IDENTITY,
            children,
        })
    }

    fn transform(&mut self) -> Result<NodeKind, VrmlRefusal> {
        let mut children = Vec::new();
        let (mut translation, mut center, mut scale) = ([0.0; 3], [0.0; 3], [1.0; 3]);
        let (mut rotation, mut scale_axes) = (Affine::IDENTITY, [Affine::IDENTITY; 2]);
        self.body("Transform", |parser, field| {
            match field {
                "translation" => translation = parser.vector(field)?,
                "center" => center = parser.vector(field)?,
                "rotation" => rotation = parser.rotation(field)?[0],
                "scaleOrientation" => scale_axes = parser.rotation(field)?,
                "scale" => scale = parser.scale()?,
                "children" => children.extend(parser.children()?),
                _ => return Ok(false),
            }
            Ok(true)
        })?;
        // VRML97, 6.52: T × C × R × SR × S × −SR × −C.
        let steps = [
            Affine::translation(center),
            rotation,
            scale_axes[0],
            Affine::scaling(scale),
            scale_axes[1],
            Affine::translation(center.map(|part| -part)),
        ];
        let map = steps
            .iter()
            .fold(Affine::translation(translation), |map, step| {
                map.after(step)
            });
        Ok(NodeKind::Group { map, children })
    }

    fn scale(&mut self) -> Result<Xyz, VrmlRefusal> {
        let scale = self.vector("scale")?;
        if scale.contains(&0.0) {
            return Err(self.refuse("a scale of 0; expected three numbers other than 0"));
        }
        Ok(scale)
    }

    fn inline(&mut self) -> Result<NodeKind, VrmlRefusal> {
        let line = self.tokens.line();
        let mut urls = Vec::new();
        self.body("Inline", |parser, field| {
            let known = field == "url";
            if known {
                urls = parser.texts()?;
            }
            Ok(known)
        })?;
        let children = self.reading.inline(&urls, line, self.level)?;
        Ok(NodeKind::Group {
            map: Affine::IDENTITY,
            children,
        })
    }

    /// Reads the fields between the braces of a node; `field` reads the value of those it knows and says so. The others are
    /// skipped, with a warning where the node has no such field by the standard.
    pub(super) fn body(
        &mut self,
        node_type: &str,
        mut field: impl FnMut(&mut Self, &'a str) -> Result<bool, VrmlRefusal>,
    ) -> Result<(), VrmlRefusal> {
        self.expect(Token::OpenBrace)?;
        let opened = self.tokens.line();
        loop {
            match self.tokens.next()? {
                Token::CloseBrace => return Ok(()),
                Token::Word(name) => {
                    let line = self.tokens.line();
                    if !self.other_statement(name)? && !field(self, name)? {
                        if let Some(strange) = strange_field(node_type, name) {
                            self.reading.warn(&strange, &self.file, line);
                        }
                        self.skip_value(name)?;
                    }
                }
                Token::End => return Err(self.refuse_end(node_type, opened, Token::CloseBrace)),
                found => {
                    return Err(self.refuse(format!(
                        "found {found}; expected a field of {node_type} or `}}`"
                    )));
                }
            }
        }
    }

    fn children(&mut self) -> Result<Vec<usize>, VrmlRefusal> {
        if self.tokens.peek()? != Token::OpenBracket {
            return Ok(self.statement()?.into_iter().collect());
        }
        self.expect(Token::OpenBracket)?;
        let opened = self.tokens.line();
        let mut children = Vec::new();
        loop {
            match self.tokens.peek()? {
                Token::CloseBracket => break,
                Token::End => {
                    self.tokens.next()?;
                    return Err(self.refuse_end("children", opened, Token::CloseBracket));
                }
                _ => children.extend(self.statement()?),
            }
        }
        self.expect(Token::CloseBracket)?;
        Ok(children)
    }

    /// Reads an axis and an angle; returns the rotation and its inverse.
    pub(super) fn rotation(&mut self, field: &str) -> Result<[Affine; 2], VrmlRefusal> {
        let axis = self.vector(field)?;
        let angle_rad = self.number(field)?;
        Ok([
            Affine::rotation(axis, angle_rad),
            Affine::rotation(axis, -angle_rad),
        ])
    }

    /// Reads one number.
    pub(super) fn number(&mut self, field: &str) -> Result<f64, VrmlRefusal> {
        let word = self.word(&format!("a number for {field}"))?;
        match word.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            Ok(_) => Err(self.refuse(format!("`{word}` for {field}; expected a finite number"))),
            Err(_) => Err(self.refuse(format!(
                "found {}; expected a number for {field}",
                Token::Word(word)
            ))),
        }
    }

    /// Reads three numbers.
    pub(super) fn vector(&mut self, field: &str) -> Result<Xyz, VrmlRefusal> {
        Ok([
            self.number(field)?,
            self.number(field)?,
            self.number(field)?,
        ])
    }

    /// Reads one string, or several between brackets.
    fn texts(&mut self) -> Result<Vec<&'a str>, VrmlRefusal> {
        let mut texts = Vec::new();
        let mut in_list = false;
        loop {
            match self.tokens.next()? {
                Token::Text(text) => texts.push(text),
                Token::OpenBracket if !in_list => in_list = true,
                Token::CloseBracket if in_list => return Ok(texts),
                found => {
                    return Err(
                        self.refuse(format!("found {found}; expected an address in quotes"))
                    );
                }
            }
            if !in_list {
                return Ok(texts);
            }
        }
    }

    /// Reads a word; `what` says what it was to be.
    pub(super) fn word(&mut self, what: &str) -> Result<&'a str, VrmlRefusal> {
        match self.tokens.next()? {
            Token::Word(word) => Ok(word),
            found => Err(self.refuse(format!("found {found}; expected {what}"))),
        }
    }

    /// Steps over one token that must be there.
    pub(super) fn expect(&mut self, expected: Token<'_>) -> Result<(), VrmlRefusal> {
        match self.tokens.next()? {
            found if found == expected => Ok(()),
            found => Err(self.refuse(format!("found {found}; expected {expected}"))),
        }
    }

    /// Steps over a field's value, whatever it is.
    pub(super) fn skip_value(&mut self, field: &str) -> Result<(), VrmlRefusal> {
        match self.tokens.peek()? {
            Token::OpenBracket => self.skip_block(Token::OpenBracket),
            Token::Text(_) => self.tokens.next().map(drop),
            _ => match self.word(&format!("a value for the field `{field}`"))? {
                "TRUE" | "FALSE" | "NULL" => Ok(()),
                "USE" | "IS" => self.word("a name").map(drop),
                "DEF" => {
                    let name = self.word("a name after DEF")?;
                    self.names.entry(name).or_insert(Named::Skipped);
                    self.word("a node type after DEF and its name")?;
                    self.skip_block(Token::OpenBrace)
                }
                word if is_number_like(word) => {
                    while matches!(self.tokens.peek()?, Token::Word(next) if is_number_like(next)) {
                        self.tokens.next()?;
                    }
                    Ok(())
                }
                _ => self.skip_block(Token::OpenBrace),
            },
        }
    }

    /// Steps over everything from an opening bracket to the one that closes it.
    pub(super) fn skip_block(&mut self, opening: Token<'a>) -> Result<(), VrmlRefusal> {
        self.expect(opening)?;
        let opened = self.tokens.line();
        let mut closings = vec![closing_of(opening)];
        while let Some(closing) = closings.last() {
            match self.tokens.next()? {
                token @ (Token::OpenBrace | Token::OpenBracket) => closings.push(closing_of(token)),
                token @ (Token::CloseBrace | Token::CloseBracket) if token == *closing => {
                    closings.pop();
                }
                found @ (Token::CloseBrace | Token::CloseBracket) => {
                    return Err(self.refuse(format!("found {found}; expected {closing}")));
                }
                Token::Word("DEF") => {
                    let name = self.word("a name after DEF")?;
                    self.names.entry(name).or_insert(Named::Skipped);
                }
                Token::Word(_) | Token::Text(_) => {}
                Token::End => return Err(self.refuse_end("what is skipped", opened, *closing)),
            }
            if closings.len() > 2 * MAX_LEVELS {
                return Err(self.refuse(format!(
                    "brackets are nested deeper than {} levels",
                    2 * MAX_LEVELS
                )));
            }
        }
        Ok(())
    }

    /// Notes that a node type is skipped.
    pub(super) fn warn_skipped(&mut self, node_type: &str) {
        self.reading
            .warn_skipped(node_type, &self.file, self.tokens.line());
    }

    /// Makes a refusal at the line of the token read last.
    pub(super) fn refuse(&self, reason: impl Into<String>) -> VrmlRefusal {
        VrmlRefusal::at(self.tokens.line(), reason)
    }

    fn refuse_end(&self, what: &str, opened: usize, expected: Token<'_>) -> VrmlRefusal {
        self.refuse(format!(
            "the file ends inside {what}, opened in line {opened}; expected {expected}"
        ))
    }
}

fn closing_of(opening: Token<'_>) -> Token<'static> {
    match opening {
        Token::OpenBracket | Token::CloseBracket => Token::CloseBracket,
        Token::OpenBrace | Token::CloseBrace | Token::Word(_) | Token::Text(_) | Token::End => {
            Token::CloseBrace
        }
    }
}

fn is_number_like(word: &str) -> bool {
    word.starts_with(|first: char| first.is_ascii_digit() || matches!(first, '+' | '-' | '.'))
}
