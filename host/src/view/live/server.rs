//! Serving the page: this computer alone, and nobody for ever.
//!
//! A connection that does not send its request, or does not take what it asked for, is closed; so
//! many are open at a time, and a page is sent only what it takes.

mod answer;
mod assets;
mod guard;
mod routes;

use std::net::TcpListener as Listener;
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
use super::hub::Hub;
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

/// Serves pages until `done` says so.
pub fn serve(
    listener: Listener,
    hub: &Arc<Hub>,
    commands: SyncSender<Command>,
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
        let accepting = tokio::spawn(accept(listener, app));
        while !done() {
            tokio::time::sleep(ASK).await;
        }
        accepting.abort();
        anyhow::Ok(())
    })
}

async fn accept(listener: TcpListener, app: Arc<App>) {
    let room = Arc::new(Semaphore::new(CONNECTIONS));
    loop {
        let Ok(place) = Arc::clone(&room).acquire_owned().await else {
            return;
        };
        let Ok((stream, _)) = listener.accept().await else {
            // No more files can be opened, or it was gone at once.
            tokio::time::sleep(ASK).await;
            continue;
        };
        let app = Arc::clone(&app);
        tokio::spawn(async move {
            answer_all(stream, app).await;
            drop(place);
        });
    }
}

/// Answers the requests of a connection.
async fn answer_all(stream: TcpStream, app: Arc<App>) {
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(STUCK));
    let service = service_fn(move |request| {
        let app = Arc::clone(&app);
        async move { anyhow::Ok(app.answer(request).await) }
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIME)
        .max_buf_size(HEAD)
        .serve_connection(TokioIo::new(Box::pin(stream)), service);
    // One that was broken off concerns nobody else.
    let _ = connection.await;
}
