"""What training shows: labelled pictures, seen as another drone might have, in batches."""
