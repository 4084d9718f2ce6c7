//! One image on an emulated board, alone.

use std::path::PathBuf;

use wheeleg_remote_host::Line as _;
use wheeleg_remote_host::unicorn::{Place, Unicorn};
use wheeleg_remote_link::{Inputs, Power, Ran, Reply, Request, Run};

/// One emulated board by itself.
pub(crate) struct Board(Unicorn);

impl Board {
    pub(crate) fn new(image: PathBuf) -> Self {
        Self(Unicorn::start(&[image], Place::Near).expect("the emulator"))
    }

    pub(crate) fn ask(&mut self, request: &Request) -> Reply {
        self.0.queue(0, request).expect("queued");
        self.0.flush().expect("sent");
        self.0.receive().expect("a reply").1
    }

    pub(crate) fn ran(&mut self, request: &Request) -> Ran {
        match self.ask(request) {
            Reply::Ran(ran) => ran,
            other => panic!("{other:?}"),
        }
    }
}

/// A tick edge with the potentiometer near the middle of its stroke.
pub(crate) fn edge(until_ns: u64, power: Power) -> Request {
    Request::Run(Run {
        until_ns,
        edge: Some(Inputs {
            adc: 30_000,
            ..Inputs::default()
        }),
        power,
        byte_ns: 10_000,
        ..Run::default()
    })
}
