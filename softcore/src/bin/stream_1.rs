//! 1 macropixel, photons from the FIFO, events to the link.

#![no_std]
#![no_main]

dtof_softcore::stream_program!(1);
