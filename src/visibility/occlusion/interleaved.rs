//! The interleaved coupling: the tree is walked front to back; blocks are tested
//! before they are opened; what is found visible and large is drawn at once.
