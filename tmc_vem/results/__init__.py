"""What a run leaves behind, as data: records, fields, files, findings."""
