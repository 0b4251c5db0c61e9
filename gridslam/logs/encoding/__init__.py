"""Building blocks of the codecs of all kinds: CDR, rows of CSV, pictures, common fields."""
