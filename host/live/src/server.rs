//! Serving the page: this computer alone, and nobody for ever.
//!
//! A connection that does not send its request, or does not take what it asked for, is closed; so
//! many are open at a time, and a page is sent only what it takes.

mod answer;
mod assets;
mod routes;

use std::net::TcpListener as Listener;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use std::time::Duration;

use anyhow::Result;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio_io_timeout::TimeoutStream;

use super::feed::Command;
use super::foxglove::Foxglove;
#[cfg(feature = "foxglove")]
use super::foxglove::{App as Clients, MOST_CLIENTS};
use super::hub::Hub;
use super::terminal::Terminal;
use routes::App;

/// Connections at a time, at most. Others wait to be taken.
const CONNECTIONS: usize = 64;
/// Bytes of a request's head, at most.
const HEAD: usize = 16 * 1024;
/// A request's head takes no longer to come.
const HEAD_TIME: Duration = Duration::from_secs(5);
/// A reader that takes nothing for so long is gone.
const STUCK: Duration = Duration::from_secs(10);
/// How often it is asked whether it is done.
const ASK: Duration = Duration::from_millis(50);

/// Serves pages and Foxglove until `done` says so.
pub fn serve(
    listener: Listener,
    foxglove: Option<Foxglove>,
    hub: &Arc<Hub>,
    commands: SyncSender<Command>,
    terminal: Terminal,
    done: impl Fn() -> bool,
) -> Result<()> {
    let port = listener.local_addr()?.port();
    listener.set_nonblocking(true)?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_io()
        .enable_time()
        .build()?;
    let app = Arc::new(App {
        hub: Arc::clone(hub),
        commands,
        port,
    });
    runtime.block_on(async {
        let listener = TcpListener::from_std(listener)?;
        tokio::spawn(accept(listener, CONNECTIONS, move |stream| {
            answer_all(stream, Arc::clone(&app))
        }));
        #[cfg(not(feature = "foxglove"))]
        let _ = (foxglove, terminal);
        #[cfg(feature = "foxglove")]
        if let Some(foxglove) = foxglove {
            let clients = Arc::new(Clients::new(Arc::clone(hub), &foxglove, terminal));
            foxglove.listener.set_nonblocking(true)?;
            let listener = TcpListener::from_std(foxglove.listener)?;
            tokio::spawn(Arc::clone(&clients).make_frames());
            tokio::spawn(accept(listener, MOST_CLIENTS, move |stream| {
                Arc::clone(&clients).serve(stream)
            }));
        }
        while !done() {
            tokio::time::sleep(ASK).await;
        }
        anyhow::Ok(())
    })
}

/// A connection whose reader is given up if it takes nothing.
type Stream = Pin<Box<TimeoutStream<TcpStream>>>;

/// Takes at most so many connections at a time, and has each served.
async fn accept<F: Future<Output = ()> + Send + 'static>(
    listener: TcpListener,
    most: usize,
    serve: impl Fn(Stream) -> F,
) {
    let room = Arc::new(Semaphore::new(most));
    loop {
        let Ok(place) = Arc::clone(&room).acquire_owned().await else {
            return;
        };
        let Ok((stream, _)) = listener.accept().await else {
            // No more files can be opened, or it was gone at once.
            tokio::time::sleep(ASK).await;
            continue;
        };
        let mut stream = TimeoutStream::new(stream);
        stream.set_write_timeout(Some(STUCK));
        let served = serve(Box::pin(stream));
        tokio::spawn(async move {
            served.await;
            drop(place);
        });
    }
}

/// Answers the requests of a connection.
async fn answer_all(stream: Stream, app: Arc<App>) {
    let service = service_fn(move |request| {
        let app = Arc::clone(&app);
        async move { anyhow::Ok(app.answer(request).await) }
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIME)
        .max_buf_size(HEAD)
        .serve_connection(TokioIo::new(stream), service);
    // One that was broken off concerns nobody else.
    let _ = connection.await;
}
