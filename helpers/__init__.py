"""What a notebook needs and a terminal does not: sessions, records, queues, pictures, checks."""
