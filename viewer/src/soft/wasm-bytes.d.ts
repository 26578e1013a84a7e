declare module '*?wasm-bytes' {
  /** The module's bytes, base64. */
  const encoded: string;
  export default encoded;
}
