//! `sweepd query --batch`: shape-pair questions answered offline.

use std::fs::File;
use std::io::{BufRead, BufReader};

use crate::error::{Error, Result};
use crate::query::batch;

use super::args::QueryArgs;
use super::out::Out;

/// Answers a file of cases; `false` when a line could not be read.
pub(super) fn query(args: &QueryArgs, out: &mut Out) -> Result<bool> {
    let input: Box<dyn BufRead> = if args.batch.as_os_str() == "-" {
        Box::new(BufReader::new(std::io::stdin()))
    } else {
        let file = File::open(&args.batch).map_err(|e| {
            Error::Usage(format!(
                "{}: {e}; give a file of cases, or - for standard input",
                args.batch.display()
            ))
        })?;
        Box::new(BufReader::new(file))
    };
    let all_read = batch::run(input, out.sink())?;
    out.flush()?;
    Ok(all_read)
}
