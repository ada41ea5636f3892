"""Files of rooms: made, read, checked, shown, described and exported.

`make` plans and makes them, `render` and `pack` make their rows; `reader` reads a file row by row;
`verify` checks it; `info`, `preview` and `export` turn it into text, a picture, and other tools'
formats.

It may import everything in `scenegen` but the commands. Start with `reader`, then `make`.
"""
