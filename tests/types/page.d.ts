// What the check of types (check.sh) is told beside the page's modules: elements are asked for by names that a test compares with
// the page, not by types; and whoever hears a key asks what it went to.
interface Document { getElementById(elementId: string): any; }
interface ParentNode { querySelector(selectors: string): any; querySelectorAll(selectors: string): NodeListOf<any>; }
interface EventTarget { matches?: any; }
