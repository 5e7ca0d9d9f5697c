//! `sweepd query`: shape-pair questions answered offline, or questions to a running daemon about its bodies.

mod gap;
mod impact;
mod live;
mod ray;
mod touching;

use std::fmt::Display;
use std::fs::File;
use std::io::{BufRead, BufReader, IsTerminal as _, Read};
use std::path::Path;

use crate::error::{Error, Result};
use crate::query::batch;

use super::args_query::QueryArgs;
use super::out::Out;
use super::progress::Progress;

/// Answers the query; `false` if a line of a batch file could not be read.
pub(super) fn query(args: &QueryArgs, out: &mut Out) -> Result<bool> {
    // A signal ends a batch like any process: there is nothing to close.
    if let Some(file) = &args.batch {
        return of_file(file, out);
    }
    let stop = super::stop()?;
    if let Some(numbers) = args.ray.ray {
        return ray::ray(numbers, args, out, stop.as_ref());
    }
    match (&args.a, &args.b) {
        _ if args.touching.touching.is_some() || args.touching.shape.is_some() => {
            touching::touching(args, out, stop.as_ref())
        }
        (Some(a), Some(b)) if args.impact.impact.is_some() => {
            impact::impact(a, b, args, out, stop.as_ref())
        }
        (Some(a), Some(b)) => gap::gap(a, b, args, out, stop.as_ref()),
        _ => Err(Error::Usage(
            "name two bodies of a running daemon, ask with --touching NAME, --shape JSON or --ray X,Y,Z,DX,DY,DZ, or give a file \
             of cases with --batch FILE"
                .to_owned(),
        )),
    }
}

fn of_file(path: &Path, out: &mut Out) -> Result<bool> {
    let input: Box<dyn BufRead> = if path.as_os_str() == "-" {
        Box::new(BufReader::new(std::io::stdin()))
    } else {
        let is_none = |why: &dyn Display| {
            Error::Usage(format!(
                "{}: {why}; give a file of cases, or - for standard input",
                path.display()
            ))
        };
        let file = File::open(path).map_err(|e| is_none(&e))?;
        if file.metadata().is_ok_and(|about| about.is_dir()) {
            return Err(is_none(&"this is a folder"));
        }
        // Answers that are printed on a terminal show the progress themselves.
        if std::io::stdout().is_terminal() {
            Box::new(BufReader::new(file))
        } else {
            Box::new(BufReader::new(Followed::new(file)))
        }
    };
    let all_read = batch::run(input, out.sink())?;
    out.flush()?;
    Ok(all_read)
}

/// A file whose reading shows a progress line.
struct Followed {
    file: File,
    done: u64,
    all: u64,
    progress: Progress,
}

impl Followed {
    fn new(file: File) -> Self {
        Self {
            all: file.metadata().map_or(0, |about| about.len()),
            file,
            done: 0,
            progress: Progress::new(),
        }
    }
}

impl Read for Followed {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        let taken = self.file.read(to)?;
        self.done += taken as u64;
        self.progress
            .tell(self.done, self.all, "bytes of cases read");
        Ok(taken)
    }
}
