"""What codecs of all kinds are made of: CDR, rows of CSV, pictures, common fields."""
