"""The ring without clicks: lines of both planes, circles that both support, the curve along them, and a judgement."""
