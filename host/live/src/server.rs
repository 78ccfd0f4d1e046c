//! Serves the page to this computer alone.
//!
//! A connection is closed if its request does not arrive or its answer is not read in time. The
//! number of connections is bounded, and a page is sent only as much as it reads.

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

use super::Terminal;
use super::feed::PageRequest;
use super::foxglove::Foxglove;
#[cfg(feature = "foxglove")]
use super::foxglove::{App as Clients, MOST_CLIENTS};
use super::hub::Hub;
use routes::App;

/// Most connections at a time. Others wait to be accepted.
const CONNECTIONS: usize = 64;
/// Most bytes of a request's head.
const HEAD: usize = 16 * 1024;
/// Longest wait for a request's head.
const HEAD_TIME: Duration = Duration::from_secs(5);
/// A reader that reads nothing for so long is disconnected.
const STUCK: Duration = Duration::from_secs(10);
/// Interval of calls of `done`, and of retries.
const POLL: Duration = Duration::from_millis(50);

/// Serves pages and Foxglove until `done` returns true.
pub fn serve(
    listener: Listener,
    foxglove: Option<Foxglove>,
    hub: &Arc<Hub>,
    requests: SyncSender<PageRequest>,
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
        requests,
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
            tokio::time::sleep(POLL).await;
        }
        anyhow::Ok(())
    })
}

/// A connection that fails if its reader reads nothing.
type Stream = Pin<Box<TimeoutStream<TcpStream>>>;

/// Accepts connections, at most `most` at a time, and serves each.
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
            // Too many open files, or the connection was closed at once.
            tokio::time::sleep(POLL).await;
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
    // An error ends this connection only.
    let _ = connection.await;
}
