// The page's line to the server: JSON goes out; a header of JSON and arrays of float32 come back.

class Talk {
  constructor(hear) {
    this.hear = hear;
    const address = new URL(`talk${location.search}`, location.href.replace(/^http/, "ws"));
    this.socket = new WebSocket(address);
    this.socket.binaryType = "arraybuffer";
    this.socket.onmessage = (event) => this.hear(unpackMessage(event.data));
    this.socket.onopen = () => this.say({ type: "open" });
    this.socket.onclose = () => this.hear({ type: "fault", text: "The server is gone, or has as many pages as it keeps. Load this page again.", final: true });
  }

  say(message) {
    if (this.socket.readyState !== WebSocket.OPEN) return;
    this.socket.send(JSON.stringify(message));
  }
}

function unpackMessage(data) {
  const length = new DataView(data).getUint32(0, true);
  const message = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  let start = 4 + length;
  for (const [name, size] of message.arrays) {
    message[name] = new Float32Array(data, start, size);
    start += 4 * size;
  }
  return message;
}

const byId = (id) => document.getElementById(id);
