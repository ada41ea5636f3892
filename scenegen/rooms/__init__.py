"""Files of rooms: made, read, checked, shown, described and exported.

`make` renders a data set and `writer` writes it; `reader` reads it row by row; `verify` checks
it; `info`, `preview` and `export` turn it into text, a picture, and other tools' formats.

It may import everything in `scenegen` but the commands. Start with `reader`, then `make`.
"""
