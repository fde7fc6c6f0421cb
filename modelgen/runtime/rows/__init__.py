"""From records to rows: filtered, differentiated, decimated, masked."""
