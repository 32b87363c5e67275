/* Search from file://, where browsers refuse workers: a worker in a frame. The theme else loads such a script from the network. */
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super()
      this.waiting = []
      const start = () => {
        const frame = document.createElement("iframe")
        frame.hidden = true
        document.body.appendChild(frame)
        const inner = frame.contentWindow
        inner.postMessage = data => this.dispatchEvent(new MessageEvent("message", { data }))
        const script = inner.document.createElement("script")
        script.src = new URL(url, document.baseURI).href
        script.onload = () => {
          this.postMessage = data => inner.dispatchEvent(new MessageEvent("message", { data }))
          this.waiting.forEach(data => this.postMessage(data))
        }
        inner.document.body.appendChild(script)
      }
      document.body ? start() : addEventListener("DOMContentLoaded", start)
    }

    postMessage(data) {
      this.waiting.push(data)
    }
  }
}
