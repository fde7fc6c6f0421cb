"""One self-contained HTML page that shows what an identification found, and what it rests on."""
