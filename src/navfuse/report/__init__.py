"""What people look at: the HTML page of a run, figures for papers, tables for the terminal."""
