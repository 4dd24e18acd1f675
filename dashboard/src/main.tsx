import "@preact/signals";
import { render } from "preact";
import { App } from "./app";
import "./theme";
import "./styles/tokens.css";
import "./styles/base.css";
import "./styles/layout.css";
import "./styles/components.css";
import "./styles/drawings.css";
import "./styles/answers.css";

const root = document.getElementById("app");
if (root) render(<App />, root);
