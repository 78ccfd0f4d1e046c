/* A device with a simulated sensor, for `dtof monitor --device tcp:127.0.0.1:PORT`:
 *
 *     device [PORT]     default: a free port, which it prints
 *
 * On a microcontroller a UART replaces the socket, and a TDC replaces `simulate`. The program ends
 * when the host disconnects.
 *
 * The sensor stands for a laser: it is off unless a live host has configured it. Each start and
 * stop prints a line. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <dtof.h>

#define PIXELS 64u
/* Of 2 x 2, 4 x 4 and 8 x 8 pixels. */
#define BLOCKS 21u
#define BIN_WIDTH_PS_Q16 (250u << 16)
#define LASER_HZ 1000u
/* Bins for which the TDC is blind after a photon: none. */
#define DEAD_TIME 0u

static dtof_link_t link_to_host;
static dtof_place_t places[PIXELS];
static dtof_block_t blocks[BLOCKS];
static dtof_array_t array;
static dtof_aer_encoder_t encoder;
static dtof_report_t report;
static int is_configured, sensor_runs;
/* From the configuration: how long the host may be silent. */
static uint16_t host_timeout_ms;

/* Words that wait for the link. */
static uint8_t words[15 * DTOF_WORD_BYTES];
static size_t filled;

/* An answer that waits for the link. It goes out before anything else is done. */
static uint8_t answer_kind, answer[DTOF_BODY_BYTES];
static size_t answer_length;
static int has_answer;

/* A requested histogram is sent in parts. */
static uint16_t histogram_of;
static size_t histogram_part;
static int sends_histogram;

static void fail(const char *where, const char *why)
{
    /* A board switches its laser off here, before anything else. */
    sensor_runs = 0;
    fprintf(stderr, "error: %s: %s\n", where, why);
    exit(EXIT_FAILURE);
}

static void check(const char *what, dtof_status_t status)
{
    if (status != DTOF_OK) {
        fail(what, dtof_status_text(status));
    }
}

static uint32_t now_ms(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)now.tv_sec * 1000u + (uint32_t)(now.tv_nsec / 1000000);
}

static void start_sensor(void)
{
    /* Switch your laser on here, and nowhere else. */
    sensor_runs = 1;
    report.sensor_starts++;
    printf("sensor on\n");
    fflush(stdout);
}

/* Only another configuration starts it again. The host gets the reason. */
static void stop_sensor(uint8_t reason)
{
    if (!sensor_runs) {
        return;
    }
    /* Switch your laser off here, before anything else. */
    sensor_runs = 0;
    report.sensor_stops++;
    report.stop_reason = reason;
    check("reason", dtof_link_set_stop_reason(&link_to_host, reason));
    printf("sensor off, reason %u\n", (unsigned)reason);
    fflush(stdout);
}

/* Applies the host's configuration. After an error the one before stays in force. */
static dtof_status_t configure(const dtof_message_t *message)
{
    dtof_device_config_t requested;
    dtof_scale_t scale;
    dtof_status_t status = dtof_device_config_read(message->body, message->length, DEAD_TIME,
                                                   &requested);
    if (status == DTOF_OK && requested.source == DTOF_SOURCE_SENSOR
        && requested.bin_width_ps_q16 != BIN_WIDTH_PS_Q16) {
        status = DTOF_ERROR_BIN_WIDTH;
    }
    /* As `dtof_sensor_write` says below, this laser cannot dither. */
    if (status == DTOF_OK && requested.dither_bins > 0) {
        status = DTOF_ERROR_DITHER;
    }
    /* 0 would switch the timeout off. */
    if (status == DTOF_OK && requested.host_timeout_ms == 0) {
        status = DTOF_ERROR_HOST_TIMEOUT;
    }
    if (status == DTOF_OK) {
        status = dtof_scale_init(&scale, requested.bin_width_ps_q16, requested.offset_mm_q8);
    }
    if (status == DTOF_OK) {
        status = dtof_array_configure_layout(&array, &requested.pixel, &requested.layout);
    }
    if (status != DTOF_OK) {
        return status;
    }
    stop_sensor(DTOF_STOP_CONFIGURATION);
    host_timeout_ms = requested.host_timeout_ms;
    is_configured = 1;
    if (requested.source == DTOF_SOURCE_SENSOR) {
        start_sensor();
    }
    return DTOF_OK;
}

static void not_understood(void)
{
    report.unknown++;
    has_answer = 0;
}

/* Handles a message of the host and prepares the answer. */
static void act(const dtof_message_t *message)
{
    has_answer = 1;
    answer_length = 0;
    switch (message->kind) {
    case DTOF_MESSAGE_CONFIGURE: {
        dtof_status_t status = configure(message);
        answer_kind = status == DTOF_OK ? DTOF_MESSAGE_CONFIGURED : DTOF_MESSAGE_REFUSED;
        answer[0] = dtof_refusal_of(status);
        answer_length = status != DTOF_OK;
        break;
    }
    case DTOF_MESSAGE_SYNCHRONISE:
        answer_kind = DTOF_MESSAGE_SYNCHRONISED;
        answer_length = message->length;
        memcpy(answer, message->body, answer_length);
        break;
    case DTOF_MESSAGE_STATISTICS_REQUEST: {
        dtof_statistics_t of_pixels, of_blocks;
        dtof_losses_t losses;
        check("statistics", dtof_array_statistics(&array, &of_pixels, &of_blocks, &losses));
        check("laser cycles", dtof_array_cycles(&array, &report.cycles));
        report.unaddressed = losses.unaddressed + losses.left_out;
        answer_kind = DTOF_MESSAGE_STATISTICS;
        answer_length = DTOF_REPORT_BYTES;
        check("report",
              dtof_report_write(&report, &of_pixels, &of_blocks, &link_to_host, answer));
        break;
    }
    case DTOF_MESSAGE_SENSOR_REQUEST:
        answer_kind = DTOF_MESSAGE_SENSOR;
        answer_length = DTOF_SENSOR_BYTES;
        check("sensor", dtof_sensor_write(PIXELS, DTOF_BINS, DEAD_TIME, 0, BIN_WIDTH_PS_Q16,
                                          LASER_HZ * 1000u, 0, answer));
        break;
    case DTOF_MESSAGE_HISTOGRAM_REQUEST: {
        uint8_t reason = is_configured ? DTOF_NO_HISTOGRAM_PIXEL : DTOF_NO_HISTOGRAM_CONFIGURATION;
        if (message->length != 2) {
            not_understood();
            break;
        }
        histogram_of = (uint16_t)(message->body[0] | message->body[1] << 8);
        answer_kind = DTOF_MESSAGE_HISTOGRAM;
        if (is_configured
            && dtof_array_histogram_write(&array, histogram_of, 0, answer, &answer_length)
                   == DTOF_OK) {
            sends_histogram = 1;
            histogram_part = 1;
            break;
        }
        check("histogram",
              dtof_no_histogram_write(histogram_of, reason, answer, &answer_length));
        break;
    }
    default:
        not_understood();
    }
}

/* Makes the next part of the histogram the answer: 0 if there is none. */
static int next_part(void)
{
    if (!sends_histogram) {
        return 0;
    }
    answer_kind = DTOF_MESSAGE_HISTOGRAM;
    check("histogram",
          dtof_array_histogram_write(&array, histogram_of, histogram_part, answer,
                                     &answer_length));
    histogram_part++;
    sends_histogram = has_answer = answer_length > 0;
    return has_answer;
}

/* Offers a message: 1 if the link took it. */
static int offer(uint8_t kind, const uint8_t *body, size_t length)
{
    dtof_status_t status = dtof_link_offer(&link_to_host, kind, body, length);
    if (status == DTOF_ERROR_FULL) {
        return 0;
    }
    check("offer", status);
    return 1;
}

/* Moves events from their slots to messages while there is room: 1 if none is left. An event without
 * room stays in its slot. */
static int send_events(void)
{
    for (;;) {
        dtof_event_t event;
        size_t length;
        if (filled + DTOF_EVENT_BYTES > sizeof words) {
            if (!offer(DTOF_MESSAGE_EVENTS, words, filled)) {
                return 0;
            }
            filled = 0;
        }
        if (dtof_array_next_event(&array, &event) != DTOF_OK) {
            break;
        }
        check("event", dtof_aer_encode(&encoder, &event, words + filled, &length));
        filled += length;
    }
    if (filled > 0 && !offer(DTOF_MESSAGE_EVENTS, words, filled)) {
        return 0;
    }
    filled = 0;
    return 1;
}

/* Does everything that needs no waiting. A request is answered after the events before it. */
static void work(void)
{
    dtof_message_t message;
    for (;;) {
        if (has_answer && !offer(answer_kind, answer, answer_length)) {
            return;
        }
        has_answer = 0;
        if (next_part()) {
            continue;
        }
        if (!send_events() || dtof_link_take(&link_to_host, &message) != DTOF_OK) {
            return;
        }
        act(&message);
    }
}

/* A laser cycle: a target in each pixel, two bins farther per row, and background. */
static void simulate(void)
{
    static uint32_t drawn = 1;
    for (uint16_t pixel = 0; pixel < PIXELS; pixel++) {
        uint16_t code;
        drawn = drawn * 1664525u + 1013904223u;
        code = (drawn >> 31) ? (uint16_t)(30 + 2 * (pixel / 8))
                             : (uint16_t)((drawn >> 16) % DTOF_BINS);
        if ((drawn >> 28) % 4 == 0) {
            check("photon", dtof_array_photon(&array, pixel, code));
        }
    }
    check("laser cycle", dtof_array_end_laser_cycles(&array, 1, NULL));
}

/* A session has begun or ended: discards the state of the one before. */
static void start_over(uint8_t session)
{
    stop_sensor(session == DTOF_SESSION_ENDED ? DTOF_STOP_END_OF_SESSION : DTOF_STOP_NEW_SESSION);
    is_configured = has_answer = sends_histogram = 0;
    filled = 0;
    check("array", dtof_array_clear(&array));
    check("encoder", dtof_aer_encoder_init(&encoder));
}

/* Stops the sensor if the host is silent. */
static void check_host(void)
{
    uint32_t silent_ms;
    check("silence", dtof_link_silent_ms(&link_to_host, now_ms(), &silent_ms));
    if (silent_ms >= host_timeout_ms) {
        stop_sensor(DTOF_STOP_SILENCE);
    }
}

/* Waits for the host. Returns a connected socket. */
static int connected(uint16_t port)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(port)};
    socklen_t size = sizeof address;
    int listener = socket(AF_INET, SOCK_STREAM, 0);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (listener < 0 || bind(listener, (struct sockaddr *)&address, size) != 0
        || listen(listener, 1) != 0
        || getsockname(listener, (struct sockaddr *)&address, &size) != 0) {
        fail("port", strerror(errno));
    }
    printf("tcp:127.0.0.1:%u\n", (unsigned)ntohs(address.sin_port));
    fflush(stdout);
    int host = accept(listener, NULL, NULL);
    if (host < 0) {
        fail("port", strerror(errno));
    }
    close(listener);
    return host;
}

/* Sends a frame: 1 if all of it was sent. It does not block on a silent host: before the timeout, the
 * device sends less than the socket's buffer holds. */
static int sent(int host, const uint8_t *bytes, size_t length)
{
    while (length > 0) {
        ssize_t gone = send(host, bytes, length, MSG_NOSIGNAL);
        if (gone < 0) {
            return 0;
        }
        bytes += gone;
        length -= (size_t)gone;
    }
    return 1;
}

int main(int arguments, char **argument)
{
    char *end = "";
    unsigned long port = arguments == 2 ? strtoul(argument[1], &end, 10) : 0;
    if (arguments > 2 || *end != 0 || port > UINT16_MAX) {
        fail("usage", "device [PORT]");
    }
    check("link", dtof_link_init(&link_to_host, sizeof link_to_host, PIXELS));
    check("array", dtof_array_init(&array, sizeof *places, places, PIXELS, blocks, BLOCKS));
    int host = connected((uint16_t)port);
    uint32_t simulated_ms = now_ms();
    for (;;) {
        uint8_t bytes[DTOF_WIRE_BYTES], session = DTOF_SESSION_UNCHANGED;
        size_t length;
        struct pollfd wait = {.fd = host, .events = POLLIN};
        if (poll(&wait, 1, 1) > 0) {
            ssize_t received = recv(host, bytes, sizeof bytes, 0);
            if (received <= 0) {
                break;
            }
            check("bytes", dtof_link_receive(&link_to_host, bytes, (size_t)received, now_ms(),
                                             &session));
        }
        if (session != DTOF_SESSION_UNCHANGED) {
            start_over(session);
        }
        check_host();
        for (uint32_t now = now_ms(); simulated_ms != now; simulated_ms++) {
            /* The histogram must not change until all parts are sent. */
            if (sensor_runs && !sends_histogram) {
                simulate();
            }
        }
        work();
        do {
            check("frame", dtof_link_transmit(&link_to_host, now_ms(), bytes, &length));
            if (!sent(host, bytes, length)) {
                stop_sensor(DTOF_STOP_NOT_LISTENING);
                return EXIT_SUCCESS;
            }
        } while (length > 0);
    }
    /* The connection is closed, as USB says that no program has the port open. */
    stop_sensor(DTOF_STOP_NOT_LISTENING);
    return EXIT_SUCCESS;
}
