// The host at the other end of the USB: it sets the device up, and opens and closes its serial
// port as a kernel does, which sets DTR and RTS.

import { createSetupPacket, DataDirection, SetupRecipient, SetupType, USBCDC } from 'rp2040js';

const SET_CONTROL_LINE_STATE = 0x22;
const DTR_AND_RTS = 0b11;
/** SIE_STATUS: the bus is in reset, is connected, and its lines, both low (SE0) or idle (J). */
const BUS_RESET = 1 << 19;
const CONNECTED = 1 << 16;
const LINES = 0b11 << 2;
const IDLE = 0b01 << 2;
/** Milliseconds of the reset of the bus that begins to set the device up. */
const FIRST_RESET_MS = 10;

export class Host {
  /**
   * `onBytes` takes what the device sends. `onClosed` is called when the device is told that
   * the port is closed, `onGone` when the device goes while the port is open.
   */
  constructor({ onBytes, onClosed, onGone }) {
    this.onBytes = onBytes;
    this.onClosed = onClosed;
    this.onGone = onGone;
    this.isOpen = false;
    this.device = null;
  }

  /** Is connected to a device, or to the same after its reset. A port that was open is gone then. */
  attach(usb) {
    if (this.isReady && this.isOpen) {
      this.isOpen = false;
      this.onGone();
    }
    this.usb = usb;
    this.begin();
  }

  /** Sets the device up once it appears. */
  begin() {
    const { usb } = this;
    const device = new USBCDC(usb);
    this.device = device;
    /** The endpoint that waits for a packet of the host, and its most bytes. */
    this.pendingRead = null;
    /** Line states that the device has not received, and whether it is about to answer one. */
    this.lines = this.isOpen ? [DTR_AND_RTS] : [];
    this.isAsking = false;
    device.onSerialData = (bytes) => this.onBytes(bytes);
    // Its own opens the port by itself, with a request that is not for the interface.
    device.cdcSetControlLineState = () => {
      device.initialized = true;
      this.ask();
    };
    usb.onUSBEnabled = () => {
      this.begin();
      this.resetBus(FIRST_RESET_MS);
    };
    // The library forgets a read request that comes before the device is known.
    usb.onEndpointRead = (endpoint, size) => {
      this.pendingRead = endpoint > 0 ? { endpoint, size } : this.pendingRead;
    };
    const { onEndpointWrite } = usb;
    usb.onEndpointWrite = (endpoint, bytes) => {
      onEndpointWrite(endpoint, bytes);
      if (endpoint === 0 && bytes.length === 0 && this.isAsking && device === this.device) {
        this.isAsking = false;
        this.ask();
      }
    };
  }

  /** Resets the bus. The chip is of version B1: it does not find the end by itself, as behind a busy hub. */
  resetBus(ms) {
    const { usb } = this;
    usb.sieStatus = (usb.sieStatus & ~(LINES | CONNECTED)) | BUS_RESET;
    usb.sieStatusUpdated();
    const end = usb.rp2040.clock.createAlarm(() => {
      usb.sieStatus |= IDLE;
    });
    end.schedule(ms * 1e6);
  }

  get isReady() {
    return this.device !== null && this.device.initialized;
  }

  open() {
    this.line(true);
  }

  close() {
    this.line(false);
  }

  line(isOpen) {
    if (isOpen !== this.isOpen) {
      this.isOpen = isOpen;
      this.lines.push(isOpen ? DTR_AND_RTS : 0);
      this.ask();
    }
  }

  /** Tells the device the next line state, if it can listen. */
  ask() {
    if (!this.isReady || this.isAsking || this.lines.length === 0) {
      return;
    }
    const value = this.lines.shift();
    this.isAsking = true;
    if (value === 0) {
      this.onClosed();
    }
    this.usb.sendSetupPacket(
      createSetupPacket({
        dataDirection: DataDirection.HostToDevice,
        type: SetupType.Class,
        recipient: SetupRecipient.Interface,
        bRequest: SET_CONTROL_LINE_STATE,
        wValue: value,
        wIndex: 0,
        wLength: 0,
      }),
    );
  }

  /** Gives the device a packet of `input`, if it waits for one. Gives whether it has. */
  send(input) {
    if (!this.isReady || this.pendingRead === null) {
      return false;
    }
    const { endpoint, size } = this.pendingRead;
    this.pendingRead = null;
    this.usb.endpointReadDone(endpoint, Uint8Array.from(input.splice(0, size)));
    return true;
  }
}
