//! Errors as people read them.

use miette::{Diagnostic, LabeledSpan, Report, Severity, SourceCode};
use std::error::Error;
use std::fmt;

/// An error with its causes, place and advice. Causes that its message tells already are not told again.
pub fn told(error: impl Diagnostic + Send + Sync + 'static) -> String {
    format!("{:?}", Report::new(Once(error)))
}

/// An error that does not repeat itself.
struct Once<E>(E);

impl<E: Diagnostic + 'static> Once<E> {
    /// The first cause that says more than the message.
    fn cause(&self) -> Option<&(dyn Error + 'static)> {
        let message = self.0.to_string();
        let mut causes = std::iter::successors(self.0.source(), |cause| (*cause).source());
        causes.find(|cause| !message.contains(&cause.to_string()))
    }
}

impl<E: Diagnostic> fmt::Display for Once<E> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0, out)
    }
}

impl<E: Diagnostic> fmt::Debug for Once<E> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&self.0, out)
    }
}

impl<E: Diagnostic + 'static> Error for Once<E> {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.cause()
    }
}

impl<E: Diagnostic + 'static> Diagnostic for Once<E> {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.0.code()
    }

    fn severity(&self) -> Option<Severity> {
        self.0.severity()
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.0.help()
    }

    fn url<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.0.url()
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.0.source_code()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.0.labels()
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        self.0.related()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("the disk is full")]
    struct Full;

    #[derive(Debug, thiserror::Error, Diagnostic)]
    enum Failure {
        #[error("cannot write a.csv: {source}")]
        #[diagnostic(help("free some space"))]
        Whole { source: Full },
        #[error("cannot write a.csv")]
        Short { source: Full },
        #[error("the report is not there")]
        Outer { source: Box<Failure> },
    }

    #[test]
    fn a_cause_is_told_once() {
        let said = |failure: Failure| told(failure).matches("the disk is full").count();
        assert_eq!(said(Failure::Whole { source: Full }), 1);
        assert_eq!(said(Failure::Short { source: Full }), 1);
        assert_eq!(said(Failure::Outer { source: Box::new(Failure::Short { source: Full }) }), 1);
        assert!(told(Failure::Whole { source: Full }).contains("free some space"));
    }
}
