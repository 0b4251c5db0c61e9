"""One run: config and log in, result and message counts out; exploration; kernels compiled ahead."""
