//! What is wrong with a configuration, said so that it can be mended: where, what, and what is
//! allowed. Knows nothing of any particular file.

use std::fmt;

/// One thing that is wrong in a file.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Problem {
    /// Name of the file, as it was opened.
    pub file: String,
    /// Line, counted from 1; 0 when only the key says where.
    pub line: usize,
    /// Full key ("vehicles.max_speed_mps"); empty where the text is no valid TOML.
    pub key: String,
    /// The value as it stands in the file, shortened; empty when there is none.
    pub value: String,
    /// What is wrong.
    pub wrong: String,
    /// What is allowed instead.
    pub allowed: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.line > 0 {
            write!(f, "{}:{}: ", self.file, self.line)?;
        } else {
            write!(f, "{}: ", self.file)?;
        }
        if !self.key.is_empty() {
            f.write_str(&self.key)?;
            if !self.value.is_empty() {
                write!(f, " = {}", self.value)?;
            }
            f.write_str(": ")?;
        }
        f.write_str(&self.wrong)?;
        if !self.allowed.is_empty() {
            write!(f, "; {}", self.allowed)?;
        }
        Ok(())
    }
}

/// Everything that is wrong, by file and line; never empty when returned as an error.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Problems(Vec<Problem>);

impl Problems {
    /// Collects problems and sorts them: one file first, the others in the order in which they were
    /// met; then by line.
    pub fn new(first_file: &str, found: Vec<Problem>) -> Problems {
        let mut files: Vec<String> = vec![first_file.to_owned()];
        for problem in &found {
            if !files.contains(&problem.file) {
                files.push(problem.file.clone());
            }
        }
        let mut sorted = found;
        sorted.sort_by_key(|problem| {
            (
                files.iter().position(|file| *file == problem.file),
                problem.line,
                problem.key.clone(),
            )
        });
        Problems(sorted)
    }

    /// Returns the problems, by file and line.
    pub fn list(&self) -> &[Problem] {
        &self.0
    }

    /// Takes the problems out.
    pub fn into_list(self) -> Vec<Problem> {
        self.0
    }
}

impl fmt::Display for Problems {
    /// Writes one line per problem, without a line break at the end.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, problem) in self.0.iter().enumerate() {
            if index > 0 {
                f.write_str("\n")?;
            }
            write!(f, "{problem}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Problems {}
