"""Every number that the five papers print, beside ours."""
